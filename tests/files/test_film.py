import threading
from fractions import Fraction
from itertools import pairwise

import av
import cv2
import numpy as np
import pytest

from perdure.errors import OutputError, ParameterError
from perdure.files.film import Film, save_png


def pictures(count: int, width: int = 64, height: int = 48) -> list[np.ndarray]:
    """A white square that walks to the right over a grey gradient."""
    made = []
    for index in range(count):
        image = (
            np.repeat(np.linspace(40, 160, width)[None, :, None], height, axis=0)
            .repeat(3, axis=2)
            .astype(np.uint8)
        )
        image[10:30, 4 + 2 * index : 20 + 2 * index] = (250, 240, 60)
        made.append(image)
    return made


def read(path) -> tuple[list[np.ndarray], list[float], str]:
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        frames = list(container.decode(stream))
        times = [float(frame.pts * Fraction(frame.time_base)) for frame in frames]
        return [frame.to_ndarray(format="rgb24") for frame in frames], times, stream.codec_context.name


def write_all(film: Film, count: int) -> None:
    for index, image in enumerate(pictures(count)):
        film.write(image, index / 25)


def film_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("film ")]


@pytest.mark.parametrize("name", ["walk.mp4", "walk.webm", "WALK.MP4"])
def test_a_film_comes_back_as_it_was_written(tmp_path, name):
    shown = pictures(12)
    with Film(tmp_path / name, 64, 48, fps=25, quality=20) as film:
        for index, image in enumerate(shown):
            film.write(image, index / 25)
    back, times, codec = read(tmp_path / name)
    assert "vp9" in codec
    assert len(back) == 12
    assert times == pytest.approx([index / 25 for index in range(12)], abs=0.0011)
    assert min(cv2.PSNR(one, other) for one, other in zip(shown, back, strict=True)) > 28
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert not film_threads()


def test_uneven_times_are_kept_from_the_first_frame_on(tmp_path):
    times = [7.0, 7.04, 7.5, 7.5001, 9.25]
    with Film(tmp_path / "uneven.mp4", 64, 48, fps=10) as film:
        for image, time in zip(pictures(5), times, strict=True):
            film.write(image, time)
    assert read(tmp_path / "uneven.mp4")[1] == pytest.approx([time - 7.0 for time in times], abs=2e-5)


@pytest.mark.parametrize("name", ["stuck.mp4", "stuck.webm"])
def test_times_that_do_not_grow_are_the_very_next(tmp_path, name):
    with Film(tmp_path / name, 64, 48, fps=10) as film:
        for image, time in zip(pictures(5), [0.0, 0.1, 0.1, 0.05, 0.3], strict=True):
            film.write(image, time)
    times = read(tmp_path / name)[1]
    assert len(times) == 5
    assert all(later > earlier for earlier, later in pairwise(times))
    assert times[-1] == pytest.approx(0.3, abs=1e-3)


@pytest.mark.parametrize(("width", "height"), [(63, 47), (64, 47), (1, 1), (17, 2)])
def test_an_odd_size_grows_by_one(tmp_path, width, height):
    with Film(tmp_path / "odd.mp4", width, height, fps=25) as film:
        for index in range(3):
            film.write(np.full((height, width, 3), 140, np.uint8), index / 25)
    back = read(tmp_path / "odd.mp4")[0]
    assert back[0].shape == (height + height % 2, width + width % 2, 3)
    assert abs(int(back[-1][-1, -1, 0]) - 140) < 12  # the added row and column are repeated ones, not black


def test_the_index_stands_before_the_pictures_so_that_a_browser_can_begin(tmp_path):
    with Film(tmp_path / "fast.mp4", 64, 48, fps=25) as film:
        for index, image in enumerate(pictures(5)):
            film.write(image, index / 25)
    content = (tmp_path / "fast.mp4").read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")


def test_a_picture_may_be_used_again_at_once(tmp_path):
    image = np.zeros((48, 64, 3), np.uint8)
    with Film(tmp_path / "again.mp4", 64, 48, fps=25, quality=10) as film:
        for index in range(10):
            image[:] = 20 * index
            film.write(image, index / 25)
    brightness = [float(frame.mean()) for frame in read(tmp_path / "again.mp4")[0]]
    assert brightness == pytest.approx([20 * index for index in range(10)], abs=8)


def test_a_film_that_breaks_off_leaves_nothing_and_spares_the_old_one(tmp_path):
    path = tmp_path / "kept.mp4"
    path.write_bytes(b"the old one")

    def film_that_breaks_off():
        with Film(path, 64, 48, fps=25) as film:
            write_all(film, 30)
            raise KeyError("broken")

    with pytest.raises(KeyError, match="broken"):
        film_that_breaks_off()
    assert path.read_bytes() == b"the old one"
    assert [one.name for one in tmp_path.iterdir()] == ["kept.mp4"]
    assert not film_threads()


def test_the_film_is_not_there_before_its_end(tmp_path):
    film = Film(tmp_path / "late.mp4", 64, 48, fps=25)
    film.write(pictures(1)[0], 0.0)
    assert not (tmp_path / "late.mp4").exists()
    film.close()
    film.close()
    assert len(read(tmp_path / "late.mp4")[0]) == 1


def test_no_frames_no_file(tmp_path):
    with Film(tmp_path / "none.mp4", 64, 48, fps=25):
        pass
    assert list(tmp_path.iterdir()) == []
    assert not film_threads()


def test_a_closed_film_takes_nothing_more(tmp_path):
    film = Film(tmp_path / "closed.mp4", 64, 48, fps=25)
    film.discard()
    film.discard()
    with pytest.raises(ValueError, match="closed"):
        film.write(pictures(1)[0], 0.0)
    film.close()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["film.avi", "film", "film.mkv"])
def test_another_ending_is_refused_with_those_that_would_do(tmp_path, name):
    with pytest.raises(OutputError, match=r"must end in \.mp4 or \.webm"):
        Film(tmp_path / name, 64, 48, fps=25)
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_named_in_one_line(tmp_path):
    (tmp_path / "file").write_text("not a folder")
    for write in (
        lambda: Film(tmp_path / "file" / "film.mp4", 64, 48, fps=25),
        lambda: save_png(tmp_path / "file" / "picture.png", pictures(1)[0]),
    ):
        with pytest.raises(OutputError, match=r"cannot write .*file") as raised:
            write()
        assert "\n" not in str(raised.value)
    assert not film_threads()


def test_a_name_that_is_taken_by_a_folder_is_refused_at_the_end(tmp_path):
    (tmp_path / "film.mp4").mkdir()
    with pytest.raises(OutputError, match="cannot write"), Film(tmp_path / "film.mp4", 64, 48, fps=25) as film:
        film.write(pictures(1)[0], 0.0)
    assert [one.name for one in tmp_path.iterdir()] == ["film.mp4"]


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"fps": 0.0}, "fps"),
        ({"fps": float("nan")}, "fps"),
        ({"quality": 64}, "quality"),
        ({"width": 0}, "pixels"),
    ],
)
def test_what_is_out_of_range_is_refused_by_name(tmp_path, wrong, named):
    with pytest.raises(ParameterError, match=named):
        Film(tmp_path / "film.mp4", **{"width": 64, "height": 48, "fps": 25.0, **wrong})


def test_a_picture_of_another_size_or_a_time_that_is_no_number_is_refused(tmp_path):
    with Film(tmp_path / "film.mp4", 64, 48, fps=25) as film:
        with pytest.raises(ValueError, match="must be"):
            film.write(np.zeros((48, 65, 3), np.uint8), 0.0)
        with pytest.raises(ValueError, match="time"):
            film.write(pictures(1)[0], float("nan"))


def test_a_failure_of_the_encoder_is_told_and_ends_the_thread(tmp_path, monkeypatch):
    def full(self, planes, ticks):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Film, "_encode_one", full)
    with pytest.raises(OutputError, match="No space left"), Film(tmp_path / "full.mp4", 64, 48, fps=25) as film:
        write_all(film, 20)
    assert list(tmp_path.iterdir()) == []
    assert not film_threads()


def test_two_films_at_once_do_not_see_each_other(tmp_path):
    with Film(tmp_path / "one.mp4", 64, 48, fps=25) as one, Film(tmp_path / "two.webm", 32, 32, fps=5) as two:
        for index, image in enumerate(pictures(6)):
            one.write(image, index / 25)
            two.write(image[:32, :32].copy(), index / 5)
    assert read(tmp_path / "one.mp4")[0][0].shape == (48, 64, 3)
    assert read(tmp_path / "two.webm")[1][-1] == pytest.approx(1.0, abs=2e-3)


@pytest.mark.parametrize("kind", ["rgb", "grey", "deep"])
def test_a_png_comes_back_to_the_pixel(tmp_path, kind):
    image = pictures(1)[0]
    image = {"rgb": image, "grey": image[..., 0], "deep": image[..., 0].astype(np.uint16) * 200}[kind]
    save_png(tmp_path / "picture.png", image)
    back = cv2.imread(str(tmp_path / "picture.png"), cv2.IMREAD_UNCHANGED)
    assert np.array_equal(back[..., ::-1] if kind == "rgb" else back, image)
    assert [one.name for one in tmp_path.iterdir()] == ["picture.png"]


def test_a_picture_of_another_ending_is_refused(tmp_path):
    with pytest.raises(OutputError, match=r"\.png"):
        save_png(tmp_path / "picture.jpg", pictures(1)[0])
