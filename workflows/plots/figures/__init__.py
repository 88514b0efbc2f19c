"""The figures of `lsm plot`: every file of this folder is one, of the name of the file.

Its docstring says in one line what it shows. It defines NEEDS, the stems of the files that it is made of, SIZE, width
and height [inches], and one of

draw_run(figure, run)
    draws the whole run: `run` is a `RunFiles`.
draw_moment(figure, moment, scale) and scale_of(moment)
    draw one `Moment` of it. `scale_of` gives {name: (low, high)} of what pictures of many moments share; in a film
    `scale` holds the least and the greatest ends of all of them.

What cannot be drawn raises an InputError that says what is missing.
"""
