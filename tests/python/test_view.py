from __future__ import annotations

import gzip
import http.client
import http.cookiejar
import urllib.error
import urllib.request
from urllib.parse import urlsplit

import pytest
from conftest import SCENE

import twofold


def open_view(slam: twofold.Slam, **options: object) -> str:
    try:
        return slam.view(port=0, **options)  # type: ignore[arg-type]
    except RuntimeError as error:
        if "built without the viewer" in str(error):
            pytest.skip(str(error))
        raise


def test_who_has_the_address_sees_the_run() -> None:
    run = twofold.run(SCENE)
    address = open_view(run.slam, title="a desk", truth=run.source.ground_truth)
    browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor(http.cookiejar.CookieJar()))
    with browser.open(address, timeout=10) as page:
        assert b"<html" in gzip.decompress(page.read()).lower()
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(urlsplit(address)._replace(query="", path="/").geturl(), timeout=10)
    assert [pose.frame for pose in run] == list(range(40))
    run.finish()
    with browser.open(urlsplit(address)._replace(query="", path="/").geturl(), timeout=10) as page:
        assert page.status == 200  # until it is closed
    run.slam.close_view()
    with pytest.raises(ConnectionRefusedError):
        http.client.HTTPConnection("127.0.0.1", urlsplit(address).port or 0, timeout=2).request("GET", "/")


def test_a_second_view_is_refused_and_names_the_first(rig: twofold.CameraRig) -> None:
    with twofold.Slam(rig) as slam:
        address = open_view(slam)
        with pytest.raises(RuntimeError) as refused:
            slam.view(port=0)
        assert address in str(refused.value)


def test_a_view_may_be_opened_again_after_it_was_closed(rig: twofold.CameraRig) -> None:
    with twofold.Slam(rig) as slam:
        first = open_view(slam)
        slam.close_view()
        slam.close_view()
        second = slam.view(port=0)
        assert second != first
        with pytest.raises(ValueError, match="port must be in"):
            twofold.Slam(rig).view(port=70000)


def test_an_open_view_does_not_keep_its_slam(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    """Images it was shown are given back, and a port it listened at is free again."""
    slam = twofold.Slam(rig)
    port = urlsplit(open_view(slam)).port
    for frame in frames:
        assert slam.wait_for_room(60)
        slam.push(frame)
    del slam
    again = twofold.Slam(rig)
    assert urlsplit(again.view(port=port or 0)).port == port
