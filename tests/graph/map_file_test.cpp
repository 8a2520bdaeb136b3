#include "graph/map_file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <sstream>

#include "fixtures/graph_invariants.hpp"
#include "tests/graph/same_map.hpp"
#include "tests/graph/sample_map.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;
using testing::expect_same;
using testing::sample_map;

class MapFileTest : public ::testing::Test {
 protected:
  MapFileTest() {
    folder_ = fs::temp_directory_path() / ("twofold_map_test_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    file_ = folder_ / "map.tfm";
  }
  ~MapFileTest() override { fs::remove_all(folder_); }

  static std::string bytes_of(const fs::path& file) {
    std::ifstream in(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  static SavedMap parse(const std::string& bytes) {
    std::istringstream in(bytes);
    return read_map(in, bytes.size(), "test");
  }
  /// Message of the error, or empty when the bytes were taken for a map.
  static std::string error_of(const std::string& bytes) {
    try {
      (void)parse(bytes);
    } catch (const MapFileError& error) {
      return error.what();
    }
    return "";
  }

  fs::path folder_, file_;
};

TEST_F(MapFileTest, WhatIsSavedIsLoaded) {
  const SavedMap map = sample_map(60, 900, 1);
  ASSERT_EQ(broken_invariant(map.graph), "");
  save_map(file_, map);
  const SavedMap loaded = load_map(file_);
  EXPECT_EQ(broken_invariant(loaded.graph), "");
  expect_same(map, loaded);
  EXPECT_FALSE(fs::exists(file_.string() + ".tmp"));
}

/// Written by the program that had format version 1.
TEST_F(MapFileTest, TheOlderFormatIsRead) {
  const SavedMap loaded = load_map(fs::path(TEST_DATA) / "map_version_1.tfm");
  EXPECT_EQ(broken_invariant(loaded.graph), "");
  expect_same(sample_map(12, 30, 14), loaded, 1e-14);
}

/// The file has what is left; of that, only points still ask for culled keyframes after loading.
TEST_F(MapFileTest, ForgottenKeyframesTakeAByte) {
  GraphWriter writer(sample_map(200, 2000, 15).graph);
  for (std::uint32_t p = 0; p < 1000; ++p) writer.cull_point(PointId{p});
  const auto size = [&](SavedMap& map) {
    map.rig = sample_map(2, 2, 1).rig;
    map.graph = writer.publish();
    save_map(file_, map);
    return fs::file_size(file_);
  };
  SavedMap map;
  const std::size_t known = known_replacements(writer.graph());
  const auto with_all = size(map);
  const GraphSnapshot before = map.graph;
  writer.forget_replacements(0, known);
  const std::size_t kept = culled_anchors(writer.graph());
  ASSERT_GT(kept, 0U);
  ASSERT_LT(kept, known);
  const auto with_needed = size(map);
  EXPECT_EQ(with_all - with_needed, (known - kept) * (4 + 7 * 8));
  const SavedMap loaded = load_map(file_);
  EXPECT_EQ(broken_invariant(loaded.graph), "");
  EXPECT_EQ(known_replacements(loaded.graph), kept);
  for (std::uint32_t p = 1000; p < 2000; ++p) {
    if (!before.point(PointId{p}).alive()) continue;
    EXPECT_LT((loaded.graph.position(PointId{p}) - before.position(PointId{p})).norm(), 1e-9);
  }
}

TEST_F(MapFileTest, AnEmptyMapAndOneOfSeveralSlices) {
  SavedMap empty;
  empty.rig.camera = {500, 500, 320, 240, 640, 480};
  save_map(file_, empty);
  EXPECT_EQ(load_map(file_).graph.keyframe_count(), 0U);
  const SavedMap large = sample_map(2100, 40000, 2);
  save_map(file_, large);
  expect_same(large, load_map(file_));
}

TEST_F(MapFileTest, EveryTruncationIsRefused) {
  save_map(file_, sample_map(8, 20, 3));
  const std::string bytes = bytes_of(file_);
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    const std::string error = error_of(bytes.substr(0, length));
    ASSERT_FALSE(error.empty()) << length;
    if (length >= 8 + 12) {
      EXPECT_NE(error.find("section"), std::string::npos) << error;
    }
  }
}

TEST_F(MapFileTest, EveryFlippedByteIsRefusedAndTheSectionNamed) {
  save_map(file_, sample_map(8, 20, 4));
  const std::string bytes = bytes_of(file_);
  for (std::size_t at = 0; at < bytes.size(); ++at) {
    std::string damaged = bytes;
    damaged[at] = static_cast<char>(damaged[at] ^ (1 << (at % 8)));
    // The header's last byte is not used.
    if (at == 7) continue;
    const std::string error = error_of(damaged);
    ASSERT_FALSE(error.empty()) << at;
    if (at >= 8) {
      EXPECT_NE(error.find("section"), std::string::npos) << error;
    }
  }
}

TEST_F(MapFileTest, BytesThatFollowAreRefused) {
  save_map(file_, sample_map(8, 20, 5));
  EXPECT_NE(error_of(bytes_of(file_) + "x").find("bytes follow"), std::string::npos);
}

TEST_F(MapFileTest, OtherVersionsAreNamed) {
  save_map(file_, sample_map(4, 10, 6));
  std::string bytes = bytes_of(file_);
  bytes[5] = 9;
  EXPECT_NE(error_of(bytes).find("format version 9"), std::string::npos);
}

TEST_F(MapFileTest, HugeLengthsAllocateNothing) {
  save_map(file_, sample_map(4, 10, 7));
  std::string bytes = bytes_of(file_);
  for (std::size_t at = 8 + 4; at < 8 + 12; ++at) bytes[at] = static_cast<char>(0x7f);
  EXPECT_NE(error_of(bytes).find("beyond the end"), std::string::npos);
}

TEST_F(MapFileTest, PlacesOfKeyframesTheGraphDoesNotHaveAreLeftOut) {
  SavedMap map = sample_map(20, 100, 13);
  const KeyframeId culled{4};
  ASSERT_TRUE(map.graph.keyframe(culled).culled());
  const KeyframeDatabase known = map.places;
  map.places.set(culled, *map.places.find(KeyframeId{6}));
  map.places.set(KeyframeId{25}, *map.places.find(KeyframeId{6}));  // described, not yet in this version
  save_map(file_, map);
  expect_same(known, load_map(file_).places);
}

TEST_F(MapFileTest, RigsThatDifferAreTold) {
  const Rig rig = sample_map(2, 2, 1).rig;
  EXPECT_EQ(rig_difference(rig, rig), "");
  Rig other = rig;
  other.baseline = 0.12;
  EXPECT_EQ(rig_difference(other, rig), "baseline is 0.12, the map's is 0.11");
  other = rig;
  other.camera.width = 752;
  EXPECT_EQ(rig_difference(other, rig), "images are 752x480, the map's are 640x480");
  other = rig;
  other.kind = SensorKind::kRgbd;
  EXPECT_EQ(rig_difference(other, rig), "sensor is RGB-D, the map's is stereo");
  other = rig;
  other.camera.cx *= 1 + 1e-9;
  other.depth_max = 5;
  EXPECT_EQ(rig_difference(other, rig), "");
}

TEST_F(MapFileTest, AFullDiskLeavesTheOldMap) {
  const SavedMap old = sample_map(10, 40, 8);
  save_map(file_, old);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{20'000, 20'000};
    setrlimit(RLIMIT_FSIZE, &limit);
    try {
      save_map(file_, sample_map(200, 3000, 9));
    } catch (const MapFileError&) {
      _exit(7);
    }
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 7);
  expect_same(old, load_map(file_));
  EXPECT_FALSE(fs::exists(file_.string() + ".tmp"));
}

TEST_F(MapFileTest, KilledWhileSavingItIsTheOldMapOrTheNewOne) {
  const SavedMap maps[] = {sample_map(30, 300, 10), sample_map(120, 4000, 11)};
  save_map(file_, maps[0]);
  std::mt19937 rng(12);
  int seen[2] = {0, 0};
  for (int trial = 0; trial < 100; ++trial) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      for (int n = 0;; ++n) save_map(file_, maps[n % 2]);
    }
    usleep(rng() % 15'000);
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    const SavedMap loaded = load_map(file_);
    const std::size_t which = loaded.graph.keyframe_count() == 30 ? 0 : 1;
    ASSERT_EQ(loaded.graph.keyframe_count(), maps[which].graph.keyframe_count());
    ASSERT_EQ(loaded.graph.point_count(), maps[which].graph.point_count());
    ++seen[which];
  }
  EXPECT_EQ(seen[0] + seen[1], 100);
}

}  // namespace
}  // namespace twofold
