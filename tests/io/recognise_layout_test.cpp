#include "io/sources/layouts/recognise_layout.hpp"

#include <string>
#include <utility>

#include "io/sources/open_source.hpp"
#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

TEST(RecogniseLayout, OneLayoutWinsWhereAFolderHasFilesOfSeveral) {
  const ScratchFolder folder;
  // Each of these goes before all that were there already.
  for (const auto& [file, scheme] : {std::pair{"times.txt", "images"},
                                     {"intrinsic/intrinsic_color.txt", "images"},
                                     {"color/12.jpg", "scannet"},
                                     {"results/frame000000.jpg", "replica"},
                                     {"frame-000000.color.png", "7scenes"},
                                     {"color.txt", "tum"},
                                     {"image_0/000000.png", "kitti"},
                                     {"mav0/cam0/data.csv", "euroc"},
                                     {"associations.txt", "tum"}}) {
    folder.write(file, "x");
    EXPECT_EQ(recognise_layout(folder.path()), scheme) << file;
  }
}

TEST(RecogniseLayout, PartsOfRecordingsThatCanBeRunAre) {
  const ScratchFolder folder;
  folder.write("MH_01_easy/mav0/cam0/data.csv", "x");
  for (const std::string path : {"MH_01_easy", "MH_01_easy/", "MH_01_easy/mav0", "MH_01_easy/mav0/"})
    EXPECT_EQ(recognise_layout(folder / path), "euroc") << path;
}

TEST(RecogniseLayout, ATooHighFolderNamesTheRecordingsInIt) {
  const ScratchFolder folder;
  folder.write("dataset/sequences/00/image_0/000000.png", "x");
  folder.write("dataset/poses/00.txt", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "dataset/sequences"),
                  "sequences: is no recording, but 00 in it is: give that folder");
  folder.write("dataset/sequences/01/image_0/000000.png", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "dataset/sequences"), "has 2 in it: give one of them, as 00");
  EXPECT_IO_ERROR(recognise_layout(folder / "dataset"), "has 2 in it: give one of them, as sequences/00");
  folder.write("chess/seq-02/frame-000000.color.png", "x");
  folder.write("chess/seq-01/frame-000000.color.png", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "chess"), "give one of them, as seq-01");
}

TEST(RecogniseLayout, ATooDeepFolderNamesTheRecordingAround) {
  const ScratchFolder folder;
  folder.write("00/image_0/000000.png", "x");
  folder.write("V1/mav0/cam0/data/1.png", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "00/image_0"),
                  "is a part of a recording: give " + (folder / "00"));
  EXPECT_IO_ERROR(recognise_layout(folder / "V1/mav0/cam0/"),
                  "is a part of a recording: give " + (folder / "V1"));
  EXPECT_IO_ERROR(recognise_layout(folder / "V1/mav0/cam0/data"),
                  "is a part of a recording: give " + (folder / "V1"));
}

TEST(RecogniseLayout, ArchivesAreToBeUnpacked) {
  const ScratchFolder folder;
  for (const std::string name : {"a.zip", "b.tgz", "c.tar.gz", "d.7z"}) {
    folder.write("archives/" + name, "x");
    EXPECT_IO_ERROR(recognise_layout(folder / ("archives/" + name)), name + ": is an archive: unpack it");
  }
  EXPECT_IO_ERROR(recognise_layout(folder / "archives"), "has archives in it, as a.zip: unpack them");
}

TEST(RecogniseLayout, WhatElseIsNoRecording) {
  const ScratchFolder folder;
  folder.write("drive/image_00/data/0000000000.png", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "drive"), "is of KITTI's raw data");
  folder.write("alone/1.png", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "alone"),
                  "nothing says when they were taken: 'images:DIR?fps=N'");
  folder.write("notes/a.txt", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "notes"), "no known layout");
  fs::create_directories(folder.path() / "empty");
  EXPECT_IO_ERROR(recognise_layout(folder / "empty"), "the folder is empty");
  EXPECT_IO_ERROR(recognise_layout(folder / "gone"), "no such file or folder");
}

TEST(RecogniseLayout, BagsOfRos2InSqliteSayHowToConvertThem) {
  const ScratchFolder folder;
  folder.write("walk/walk_0.db3", "SQLite format 3");
  folder.write("walk/metadata.yaml", "rosbag2_bagfile_information:");
  EXPECT_IO_ERROR(recognise_layout(folder / "walk/walk_0.db3"),
                  "walk_0.db3: is a ROS 2 bag in SQLite's form, which is not read: 'mcap convert walk_0.db3 "
                  "walk_0.mcap' or 'ros2 bag convert'");
  for (const char* scheme : {"mcap:", "bag:", "video:"})
    EXPECT_IO_ERROR(open_source(scheme + (folder / "walk/walk_0.db3")), "is a ROS 2 bag in SQLite's form");
  EXPECT_IO_ERROR(recognise_layout(folder / "walk"), "walk_0.db3 in it is a ROS 2 bag in SQLite's form");
  folder.write("split/metadata.yaml", "rosbag2_bagfile_information:");
  folder.write("split/split_0.db3.zstd", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "split"), "whose bag is packed, as split_0.db3.zstd: unpack it");
  EXPECT_IO_ERROR(recognise_layout(folder / "split/split_0.db3.zstd"), "is an archive: unpack it");
}

TEST(RecogniseLayout, FoldersOfBagsSayWhichFileToGive) {
  const ScratchFolder folder;
  folder.write("walk/metadata.yaml", "rosbag2_bagfile_information:");
  EXPECT_IO_ERROR(recognise_layout(folder / "walk"), "walk: is a ROS 2 bag's folder without the bag");
  folder.write("walk/walk_0.mcap", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "walk"),
                  "walk: is no recording, but walk_0.mcap in it is: give that file");
  folder.write("walk/walk_1.mcap", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "walk"), "has 2 in it: give one of them, as walk_0.mcap");
  folder.write("ros1/day.bag", "x");
  EXPECT_IO_ERROR(recognise_layout(folder / "ros1"), "day.bag in it is: give that file");
}

}  // namespace
}  // namespace twofold
