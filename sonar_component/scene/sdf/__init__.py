"""Reads SDF 1.4 to 1.11 worlds and models, as Gazebo's users have them.

Read on expat, the parser of the standard library, with a tree of our own of forty lines that keeps file and line. What
was weighed: libsdformat has Python bindings only as Debian packages and as a wheel for one Python version;
python-sdformat pins numpy below 2 and gives typed XML without frames, includes or search path; defusedxml forbids the
same dangerous things as we do, but its trees know no lines; lxml knows lines, at the price of 5 MB of compiled code for
a parser that is here already.

    xml.py       file -> elements with file and line; no document types, so no entity bombs; bounded size
    numbers.py   text -> numbers, vectors, poses
    uri.py       model://, file:// and relative references, kept inside the search path
    frames.py    names and poses within one model or world: relative_to, attached_to, nested names
    material.py  <material> -> Material
    geometry.py  <geometry> -> parts
    known.py     what changes nothing, and what is left unread and told once
    model_folder.py  model.config -> the SDF file to read
    world.py     worlds, models, includes, links -> World
"""
