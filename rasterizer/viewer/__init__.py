"""Look at a scene with a mouse, a finger or the keyboard: in a browser or in a notebook.

    browser ── message ──> server ──┐
                           widget ──┴─> session ── events ──> controls ──> orbit ──> Renderer ──> picture

A message is what was done since the last one; its answer is one picture. There is never more than one message on its
way, so that nothing piles up where drawing is slower than moving.
"""
