"""Writes bags by ROS's own library (Debian's python3-rosbag), in each of its compressions: write_bags.py FOLDER

stereo-COMPRESSION.bag: 20 pairs of 16x8 pixels of value i (left) and 100 + i (right) on /cam0/image_raw and
/cam1/image_raw at i / 10 s, mono8, beside an inertial sensor: what EuRoC and TUM-VI publish.
depth-COMPRESSION.bag: colour (PNG, compressed) and registered depth of i / 10 m, 32FC1, big-endian, at the same times, with
camera_info.
unindexed.bag: a stereo bag whose recorder was killed before it wrote the index.
"""
import struct
import sys
import zlib

import genpy
import rosbag
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, Imu

WIDTH, HEIGHT, IMAGES = 16, 8, 20


def stamped(message, i):
    message.header.stamp = genpy.Time(i // 10, i % 10 * 100_000_000)
    message.header.frame_id = "camera"
    return message


def image(i, encoding, pixel, big_endian=False):
    message = stamped(Image(height=HEIGHT, width=WIDTH, encoding=encoding), i)
    message.is_bigendian = int(big_endian)
    message.step = WIDTH * len(pixel)
    message.data = pixel * (WIDTH * HEIGHT)
    return message


def png(i, value):
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = (b"\0" + bytes([value] * (3 * WIDTH))) * HEIGHT
    message = stamped(CompressedImage(format="rgb8; png compressed bgr8"), i)
    message.data = (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", WIDTH, HEIGHT, 8, 2, 0, 0, 0)) +
                    chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))
    return message


def info(i):
    message = stamped(CameraInfo(height=HEIGHT, width=WIDTH, distortion_model="plumb_bob", D=[0.0] * 5), i)
    message.K = [20, 0, 8, 0, 20, 4, 0, 0, 1]
    message.R = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    message.P = [20, 0, 8, 0, 0, 20, 4, 0, 0, 0, 1, 0]
    return message


def write_stereo(bag):
    for i in range(IMAGES):
        t = genpy.Time(i // 10, i % 10 * 100_000_000)
        for _ in range(10):
            bag.write("/imu0", stamped(Imu(), i), t)
        bag.write("/cam1/image_raw", image(i, "mono8", bytes([100 + i])), t)
        bag.write("/cam0/image_raw", image(i, "mono8", bytes([i])), t)


def write_depth(bag):
    for i in range(IMAGES):
        t = genpy.Time(i // 10, i % 10 * 100_000_000)
        bag.write("/camera/color/camera_info", info(i), t)
        bag.write("/camera/color/image_raw/compressed", png(i, 10 + i), t)
        bag.write("/camera/aligned_depth_to_color/image_raw", image(i, "32FC1", struct.pack(">f", i / 10), True), t)


def main():
    folder = sys.argv[1]
    for compression in ("none", "bz2", "lz4"):
        for name, write in (("stereo", write_stereo), ("depth", write_depth)):
            with rosbag.Bag(f"{folder}/{name}-{compression}.bag", "w", compression=compression, chunk_threshold=2000) as bag:
                write(bag)
    killed = rosbag.Bag(f"{folder}/unindexed.bag", "w", chunk_threshold=2000)
    write_stereo(killed)
    killed._stop_writing_chunk()  # the chunks are whole, and the header says nothing of an index
    killed._file.flush()
    killed._file.close()


main()
