"""Many pictures of many models, drawn by many processes or on many machines.

In:  RenderTask each: a model, a view, options, a path        Out: files, and a RenderRecord of each

    tasks        RenderTask, RenderRecord, RenderSummary: what is asked for, and what became of it
    rendering    render_many: tasks become runs of one model, runs become jobs, outcomes become files and records
    draw_run     what a process does with a run: it loads the model and draws its pictures
    annotations  what a manifest says of a picture: its camera, and where each object is
    manifest     the file of that, in the order of the tasks, whoever draws
    datasets     COCO's annotations and BOP's folders, made of a manifest
    pools        who works on jobs: processes of this machine, an executor of concurrent.futures, Dask's workers

The caller's process alone writes: what draws sends back the bytes of files. So no death of a worker leaves half a file.
"""
