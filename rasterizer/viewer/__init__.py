"""Look at a scene with a mouse, a finger or the keyboard: in a browser or in a notebook.

In:  a scene, and messages: what was done since the last one        Out: one picture a message, and what is picked

    browser ── message ──> server ──┐
    cell ──── message ──> widget ───┴─> session ── events ──> controls ──> orbit ──> Renderer ──> picture

    session     one look at a scene: messages in, pictures out, smaller ones while something moves
    controls    what messages and events are, what each does, what is picked
    orbit       the camera that turns about a pivot
    server      `raster view`: the page, served to this machine alone
    widget      `rz.view`: the same in a cell, by anywidget
    page/       what the browser runs

There is never more than one message on its way, so that nothing piles up where drawing is slower than moving.
"""
