"""A mirror camera's localiser asks for the line points of a frame once."""

from robocup_vision import Vision
from robocup_vision.perception.line_points import LineFinder
from sim2d.rendering.random_scenes import CONDITIONS, sample


def test_line_points_are_found_once_where_both_choice_and_support_ask_for_them(ssl_field, paper_camera, monkeypatch):
    # robots hide most of the floor's edge in the last: several poses explain it, and the lines choose and bear one out
    *before, last = (one.frame for one in sample(ssl_field, paper_camera, CONDITIONS["nominal"], 4713, 9))
    vision = Vision(ssl_field, paper_camera)
    for frame in before:
        vision.look(frame)
    find, asked = LineFinder.find, []

    def counted(finder, frame):
        asked.append(find(finder, frame))
        return asked[-1]

    monkeypatch.setattr(LineFinder, "find", counted)
    first, again = vision.look(last), vision.look(last)
    assert len(asked) == 2
    assert first.pose
    assert first.pose.pose == again.pose.pose
