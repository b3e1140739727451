"""Commands of the simulator that are refused: each in one line, before anything is written."""

import pytest


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("match --field nowhere", "nowhere"),
        ("match --players 0", "players must be at least 1, got 0"),
        ("match --seconds -1", "seconds must be positive, got -1.0"),
        ("match --seconds nan", "seconds must be positive, got nan"),
        ("match --seed -3", "seed must not be negative, got -3"),
        ("match --out /dev/null", "/dev/null: cannot be written"),
        ("match --ours nobody", "there is no player 'nobody', only "),
        ("tournament --theirs nobody", "there is no player 'nobody'"),
        ("tournament --matches 0", "matches must be at least 1, got 0"),
        ("tournament --players 0", "players must be at least 1, got 0"),
        ("tournament --table plain", "a table needs at least two players, got 1"),
        ("tournament --table plain,nobody", "there is no player 'nobody'"),
        ("tournament --table --ours memory", "--table names all players: leave out --ours and --theirs"),
        ("tournament --table --matches 3", "a table needs an even number of matches of each pair"),
        ("live sim:ssl_2001 --from -1", "--from must be 0 or more"),
        ("live sim:ssl_2001 --seconds nan", "--seconds must be 0 or more"),
        ("live sim:ssl_2001 --record /no/such/folder/a.mcap", "recorded by `robocup-vision match --record`"),
        ("render --field ssl_2001 --camera sekimori --robots 200 out", "field 'ssl_2001' has no room for 200 robots"),
        ("render --field ssl_2001 --camera sekimori --obstacles 4 2 out", "obstacles must be 0 <= low <= high"),
        ("render --field ssl_2001 --camera sekimori --vignette 2 out", "vignette must be within 0 to 1"),
        ("render-hall --turns 0 out", "--turns must be positive"),
        ("render-hall --moved 2 out", "fraction must be within 0 to 1"),
        (
            "learn-goal-evidence --field spl_2020 --count 1 out.toml",
            "the goals of field 'spl_2020' do not differ in colour",
        ),
        ("learn-goal-evidence --field ssl_2001 out.toml", "carry no pinhole camera"),
        ("learn-goal-evidence --count 1 .", ".: cannot be written ("),
        ("fit-evidence --odds 1 out.toml", "--odds must be above 1, got 1"),
        ("fit-edge-evidence --cost 0 out.toml", "--cost must be positive, got 0"),
        ("fit-evidence --field msl_6x4 out.toml", "must have walls or boards"),
        ("sensors learn --out out.toml --cell 0", "--cell must be within 0 to 1 m"),
        ("sensors learn --out out.toml --range-height -1", "height_m must not be negative"),
        ("sensors learn --out out.toml --field cricket", "cricket"),
        ("sensors learn --out absent/out.toml", "its folder does not exist"),
    ],
)
def test_mistakes_are_one_line(words, message, refused, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert message in refused(*words.split())
    assert not list(tmp_path.iterdir())
