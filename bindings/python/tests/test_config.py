"""Where a configuration comes from, and what is wrong with it."""

import numpy as np
import pytest
import takt
from conftest import ARM6, ROOT, joint


def test_a_configuration_is_a_path_a_text_or_a_dictionary():
    for config in [ARM6, str(ARM6), ARM6.read_text()]:
        assert len(takt.simulate(config).axes) == 6
    with takt.simulate(joint()) as sim:
        assert [axis.name for axis in sim.axes] == ["joint"]
        sim.move(0.5)
        np.testing.assert_allclose(sim.state.position, [0.5], atol=1e-3)


def test_numbers_of_numpy_are_numbers_of_a_dictionary():
    config = joint()
    config["axis"][0]["limits"]["velocity"] = np.float64(0.25)
    assert takt.simulate(config).axes[0].velocity == 0.25


def test_what_is_wrong_is_shown_at_its_line(tmp_path):
    wrong = tmp_path / "wrong.toml"
    wrong.write_text((ROOT / "configs/first.toml").read_text().replace("velocity", "velocty"))
    with pytest.raises(takt.ConfigError, match="velocty") as refused:
        takt.simulate(wrong)
    assert "wrong.toml:9" in str(refused.value) and "did you mean" in str(refused.value)
    assert isinstance(refused.value, ValueError)


def test_a_dictionary_is_shown_as_the_text_that_it_stands_for():
    config = joint()
    config["axis"][0]["limits"]["velocity"] = "fast"
    with pytest.raises(takt.ConfigError, match='velocity = "fast"'):
        takt.simulate(config)


def test_a_file_that_is_not_there_is_named():
    with pytest.raises(takt.ConfigError, match="nowhere.toml"):
        takt.Arm("nowhere.toml")


def test_what_is_no_configuration_at_all_is_refused():
    with pytest.raises(TypeError, match="the path of a TOML file"):
        takt.simulate(7)
    with pytest.raises(TypeError, match="nothing like <class 'object'>"):
        takt.simulate({"name": object()})


def test_a_configuration_that_contains_itself_is_an_error():
    table = joint()
    table["axis"] = [table]
    with pytest.raises(TypeError, match="contain itself"):
        takt.simulate(table)
    array = []
    array.append(array)
    with pytest.raises(TypeError, match="contain itself"):
        takt.simulate({"axis": array})


def test_a_bus_is_connected_elsewhere_by_its_name():
    with pytest.raises(takt.ConfigError, match="the buses are: base, wrist"):
        takt.Arm(ARM6, buses={"waist": "can0"})
    with pytest.raises(takt.StartError, match="missing0"):
        takt.Arm(ARM6, buses={"base": "missing0"}, record=False)


def test_drives_that_cannot_be_brought_up_are_told_in_words():
    config = joint(identity={"vendor": 7})
    with pytest.raises(takt.StartError, match="axis `joint`.* identity: "):
        takt.simulate(config)
    with pytest.raises(takt.StartError, match="axis `joint`.* identity: "):
        takt.Arm(config | {"telemetry": {"record": False, "black_box": "off"}})


def test_a_recording_goes_where_it_is_told_to(tmp_path):
    file = tmp_path / "run.mcap"
    with takt.Arm(ARM6, simulated=True, record=file):
        pass
    assert file.stat().st_size > 1000


def test_the_real_time_set_up_is_reported():
    with takt.Arm(ARM6, simulated=True, record=False) as arm:
        realtime = arm.realtime
    assert set(realtime) >= {"policy", "cpu", "memory_locked", "refused", "grant_with"}
