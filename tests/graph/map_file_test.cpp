#include "graph/map_file.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#include <zlib.h>

#include <atomic>
#include <csignal>
#include <cstring>
#include <fstream>
#include <sstream>
#include <thread>

#include "fixtures/graph_invariants.hpp"
#include "fixtures/live_memory.hpp"
#include "graph/map_place.hpp"
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
  /// Content of a file's first section.
  static std::string head_of(const fs::path& file) {
    return bytes_of(file).substr(8 + 12, 1 + 4 * 8 + 2 * 4 + 4 * 8 + 8 + 3 * 4);
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

  static bool is_forgotten(const GraphSnapshot& graph, std::uint32_t k) {
    return graph.keyframe(KeyframeId{k}).culled() && graph.replacement(KeyframeId{k}).id == kNoKeyframe;
  }

  fs::path folder_, file_;
};

/// Bytes of a map file as somebody might write them by hand; checksums are right.
class HandMade {
 public:
  explicit HandMade(std::uint8_t version) : bytes_{'T', 'F', 'M', 'A', 'P', char(version), 0, 0} {}
  void section(std::uint32_t id, const std::string& content) {
    std::string section(12, '\0');
    const std::uint64_t length = content.size();
    std::memcpy(section.data(), &id, 4);
    std::memcpy(section.data() + 4, &length, 8);
    section += content;
    const auto crc = static_cast<std::uint32_t>(
        crc32_z(0, reinterpret_cast<const Bytef*>(section.data()), section.size()));
    bytes_ += section;
    bytes_.append(reinterpret_cast<const char*>(&crc), 4);
  }
  void head(const std::string& head_of_a_map, std::uint32_t keyframes, std::uint32_t points) {
    std::string head = head_of_a_map;
    std::memcpy(head.data() + head.size() - 8, &keyframes, 4);
    std::memcpy(head.data() + head.size() - 4, &points, 4);
    section(1, head);
  }
  void end() { section(0, ""); }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

/// Reads from memory and looks, whenever a section is fetched, how much of it the program holds.
class WatchedBuffer : public std::stringbuf {
 public:
  explicit WatchedBuffer(const std::string& bytes) : std::stringbuf(bytes, std::ios::in) {}
  [[nodiscard]] std::size_t most_live() const { return most_live_; }

 private:
  std::streamsize xsgetn(char* to, std::streamsize count) override {
    most_live_ = std::max(most_live_, live_heap_bytes());
    return std::stringbuf::xsgetn(to, count);
  }
  std::size_t most_live_ = 0;
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

TEST_F(MapFileTest, ALinkIsWrittenThroughAndAModeStays) {
  const SavedMap map = sample_map(2, 2, 1);
  const fs::path link = file_.string() + ".link";
  for (const bool there : {false, true}) {
    SCOPED_TRACE(there);
    fs::remove(link);
    fs::create_symlink(file_.filename(), link);
    if (there) fs::permissions(file_, fs::perms::owner_read | fs::perms::owner_write);
    save_map(link, map);
    EXPECT_TRUE(fs::is_symlink(link));
    EXPECT_FALSE(fs::is_symlink(file_));
    expect_same(map, load_map(file_));
  }
  EXPECT_EQ(fs::status(file_).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  fs::remove(link);
}

TEST_F(MapFileTest, ThreadsThatSaveToOneFileTakeTurns) {
  const SavedMap map = sample_map(60, 900, 1);
  save_map(file_, map);
  std::atomic<int> failed{0};
  const auto save_often = [&] {
    for (int i = 0; i < 40; ++i) {
      try {
        save_map(file_, map);
      } catch (const MapFileError&) {
        failed.fetch_add(1, std::memory_order_relaxed);  // a number; join orders what is read
      }
    }
  };
  {
    const std::jthread one(save_often), other(save_often);
    for (int i = 0; i < 40; ++i) EXPECT_NO_THROW((void)load_map(file_));
  }
  EXPECT_EQ(failed.load(std::memory_order_relaxed), 0);
}

TEST_F(MapFileTest, ProgramsThatSaveToOneFileLeaveItWhole) {
  constexpr int kPrograms = 3;
  const SavedMap map = sample_map(60, 900, 1);
  save_map(file_, map);
  std::vector<pid_t> programs;
  for (int n = 0; n < kPrograms; ++n) {
    programs.push_back(fork());
    ASSERT_GE(programs.back(), 0);
    if (programs.back() != 0) continue;
    try {
      for (int i = 0; i < 60; ++i) save_map(file_, map);
    } catch (const MapFileError&) {
      _exit(7);
    }
    _exit(0);
  }
  for (const pid_t program : programs) {
    int status = 0;
    while (waitpid(program, &status, WNOHANG) == 0) EXPECT_NO_THROW((void)load_map(file_));
    EXPECT_EQ(WEXITSTATUS(status), 0);
  }
  expect_same(map, load_map(file_));
  for (const auto& left : fs::directory_iterator(folder_)) EXPECT_EQ(left.path(), file_);
}

TEST_F(MapFileTest, WhatAKilledProgramLeftIsUsedAgain) {
  const SavedMap map = sample_map(2, 2, 1);
  std::ofstream(file_.string() + ".tmp") << std::string(100'000, 'x');
  save_map(file_, map);
  expect_same(map, load_map(file_));
  EXPECT_FALSE(fs::exists(file_.string() + ".tmp"));
}

TEST_F(MapFileTest, OnlyAMapIsReplaced) {
  const SavedMap map = sample_map(2, 2, 1);
  fs::remove(file_);
  ASSERT_EQ(mkfifo(file_.c_str(), 0600), 0);
  EXPECT_THROW(save_map(file_, map), MapFileError);
  EXPECT_TRUE(fs::is_fifo(file_));
  fs::remove(file_);
  std::ofstream(file_) << "a letter";
  EXPECT_THROW(save_map(file_, map), MapFileError);
  EXPECT_EQ(fs::file_size(file_), 8U);
  std::ofstream{file_};  // made beforehand, as by mktemp
  EXPECT_NO_THROW(save_map(file_, map));
  EXPECT_NO_THROW(save_map(file_, map));
  EXPECT_THROW(expect_place_for_map(file_.parent_path()), MapFileError);
}

/// Written by the programs that had these versions.
TEST_F(MapFileTest, OlderFormatsAreRead) {
  for (const char* file : {"map_version_1.tfm", "map_version_2.tfm"}) {
    const SavedMap loaded = load_map(fs::path(TEST_DATA) / file);
    EXPECT_EQ(broken_invariant(loaded.graph), "");
    expect_same(sample_map(12, 30, 14), loaded, 1e-14);
  }
}

/// The file has what is left; of that, only points still ask for culled keyframes after loading.
TEST_F(MapFileTest, ForgottenKeyframesAreOnlyCounted) {
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
  std::size_t runs = 0;
  for (std::uint32_t k = 0; k < map.graph.keyframe_count(); ++k)
    runs += is_forgotten(map.graph, k) && (k == 0 || !is_forgotten(map.graph, k - 1)) ? 1 : 0;
  EXPECT_EQ(with_all - with_needed, (known - kept) * (1 + 4 + 7 * 8) - runs * (1 + 4));
  const SavedMap loaded = load_map(file_);
  EXPECT_EQ(broken_invariant(loaded.graph), "");
  EXPECT_EQ(known_replacements(loaded.graph), kept);
  for (std::uint32_t p = 1000; p < 2000; ++p) {
    if (before.point(PointId{p}).culled()) continue;
    EXPECT_LT((loaded.graph.position(PointId{p}) - before.position(PointId{p})).norm(), 1e-9);
  }
}

/// A million keyframes and points come and go: the file counts them, and does not grow.
TEST_F(MapFileTest, WhatIsGoneTakesNoSpace) {
  SavedMap map = sample_map(60, 900, 16);
  save_map(file_, map);
  const auto before = fs::file_size(file_);
  GraphWriter writer(map.graph);
  writer.add_forgotten_keyframes(200'000);  // whatever each takes, the file shows
  writer.fill_with_culled_points(400'000);
  map.graph = writer.publish();
  save_map(file_, map);
  EXPECT_LE(fs::file_size(file_), before + (1 + 4) + (4 + 4));
  const SavedMap loaded = load_map(file_);
  EXPECT_EQ(loaded.graph.keyframe_count(), 200'060U);
  EXPECT_EQ(loaded.graph.point_count(), 400'000U);
  expect_same(map, loaded);
}

TEST_F(MapFileTest, NoFileTakesMoreMemoryThanAFewTimesItsSize) {
  save_map(file_, SavedMap{sample_map(2, 2, 1).rig, {}, {}});
  const std::string head = head_of(file_);
  for (const std::uint8_t version : {2, 3}) {
    HandMade file(version);
    constexpr std::uint32_t kSections = 1000, kEntries = 1024;
    file.head(head, kSections * kEntries, 0);
    // One forgotten keyframe each.
    std::string entries;
    for (std::uint32_t n = 0; n < kEntries; ++n)
      entries += version == 2 ? std::string(1, '\0') : std::string("\0\1\0\0\0", 5);
    for (std::uint32_t n = 0; n < kSections; ++n) file.section(2, entries);
    file.end();
    const std::size_t live = live_heap_bytes();
    WatchedBuffer buffer(file.bytes());
    const std::size_t own = live_heap_bytes() - live;
    std::istream in(&buffer);
    EXPECT_THROW((void)read_map(in, file.bytes().size(), "test"), MapFileError);  // no reference keyframe
    EXPECT_LT(buffer.most_live() - live - own, 4 * file.bytes().size()) << "version " << int{version};
  }
}

TEST_F(MapFileTest, RunsThatAreEmptyOrTooLongAreRefused) {
  save_map(file_, SavedMap{sample_map(2, 2, 1).rig, {}, {}});
  const std::string head = head_of(file_);
  const auto error = [&](std::uint32_t keyframes, std::uint32_t points, const std::string& keyframe_run,
                         const std::string& point_run) {
    HandMade file(3);
    file.head(head, keyframes, points);
    if (!keyframe_run.empty()) file.section(2, std::string(1, '\0') + keyframe_run);
    if (!point_run.empty()) file.section(3, std::string(4, '\xff') + point_run);
    file.end();
    return error_of(file.bytes());
  };
  const std::string none("\0\0\0\0", 4), five("\5\0\0\0", 4);
  EXPECT_NE(error(5, 0, none, "").find("run of nothing"), std::string::npos);
  EXPECT_NE(error(0, 5, "", none).find("run of nothing"), std::string::npos);
  EXPECT_NE(error(4, 0, five, "").find("more keyframes than announced"), std::string::npos);
  EXPECT_NE(error(0, 4, "", five).find("more points than announced"), std::string::npos);
  EXPECT_EQ(error(0, 5, "", five), "");
  EXPECT_NE(error(1U << 24 | 1, 0, five, "").find("too large a map"), std::string::npos);
}

TEST_F(MapFileTest, WhatCouldNotBeLoadedIsNotSaved) {
  SavedMap map = sample_map(4, 10, 17);
  save_map(file_, map);
  const std::string before = bytes_of(file_);
  GraphWriter writer(map.graph);
  writer.add_forgotten_keyframes(1U << 24);
  map.graph = writer.publish();
  EXPECT_THROW(save_map(file_, map), MapFileError);
  EXPECT_EQ(bytes_of(file_), before);
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
  EXPECT_EQ(rig_difference(other, rig),
            "baseline is 0.12, the map's is 0.11: things are seen up to 15 px elsewhere, accepted is 1");
  other = rig;
  other.camera.width = 752;
  EXPECT_EQ(rig_difference(other, rig), "images are 752x480, the map's are 640x480");
  other = rig;
  other.kind = SensorKind::kRgbd;
  EXPECT_EQ(rig_difference(other, rig), "sensor is RGB-D, the map's is stereo");
  other.kind = SensorKind::kMono;
  other.baseline = 0;
  EXPECT_EQ(rig_difference(other, rig), "") << "the left camera alone finds itself in the map of both";
  EXPECT_NE(rig_difference(rig, other), "");
  other = rig;
  other.camera.cx *= 1 + 1e-9;
  other.depth_max = 5;
  EXPECT_EQ(rig_difference(other, rig), "");
}

TEST_F(MapFileTest, ARigThatWasCalibratedAgainIsTheMapsUpToAPixel) {
  const Rig rig = sample_map(2, 2, 1).rig;
  EXPECT_EQ(rig_note(rig, rig), "");
  const auto half_diagonal = [&](double px) { return 1 + px / std::hypot(rig.camera.cx, rig.camera.cy); };
  const auto judge = [&](const auto& change, double px) {
    Rig other = rig;
    change(other, px);
    return std::pair(rig_difference(other, rig), rig_note(other, rig));
  };
  const auto focal = [&](Rig& other, double px) {
    other.camera.fx *= half_diagonal(px);
    other.camera.fy *= half_diagonal(px);
    other.baseline /= half_diagonal(px);  // so that disparities stay
  };
  const auto centre = [](Rig& other, double px) { other.camera.cy += px; };
  const auto baseline = [](Rig& other, double px) { other.baseline *= 1 + px / (0.25 * other.camera.width); };
  const auto expect = [&](const auto& change, const std::string& name) {
    const auto [accepted, note] = judge(change, 0.8);
    EXPECT_EQ(accepted, "");
    EXPECT_NE(note.find(name), std::string::npos) << note;
    EXPECT_NE(note.find("up to 0.8 px elsewhere"), std::string::npos) << note;
    const auto [refused, no_note] = judge(change, 1.2);
    EXPECT_NE(refused.find(name), std::string::npos) << refused;
    EXPECT_NE(refused.find("up to 1.2 px elsewhere, accepted is 1"), std::string::npos) << refused;
    EXPECT_EQ(no_note, "");
  };
  expect(focal, "focal length fx");
  expect(centre, "centre cy");
  expect(baseline, "baseline");
}

TEST_F(MapFileTest, PlacesKeepTheirDepthsInTheEyesOfARigThatWasCalibratedAgain) {
  const SavedMap map = sample_map(20, 100, 13);
  Rig other = map.rig;
  other.camera.fx *= 1.001;
  other.camera.cx += 0.5;
  other.baseline *= 0.999;
  const KeyframeDatabase seen = places_seen_by(other, map);
  int depths = 0;
  for (std::uint32_t k = 0; k < seen.size(); ++k) {
    const PlaceAppearance *a = map.places.find(KeyframeId{k}), *b = seen.find(KeyframeId{k});
    if (a == nullptr) continue;
    ASSERT_EQ(a->pixels.size(), b->pixels.size());
    for (std::size_t n = 0; n < a->pixels.size(); ++n) {
      const StereoPixel before = a->pixels[n].cast<double>(), now = b->pixels[n].cast<double>();
      EXPECT_EQ(std::isnan(before.z()), std::isnan(now.z()));
      if (std::isnan(before.z()) || before.x() - before.z() < 1) continue;
      const Vector3 x = map.rig.unproject(before);
      EXPECT_LT((other.unproject(now) - x).norm(), 1e-3 * x.norm());
      ++depths;
    }
  }
  EXPECT_GT(depths, 10);
}

TEST_F(MapFileTest, OneCameraOfAnotherSensorIsLocalisedAtTheSameAngularResolution) {
  const SavedMap map = sample_map(6, 40, 3);
  Rig other = map.rig;
  other.kind = SensorKind::kMono;
  other.camera.width = 500;
  other.camera.cx += 31;
  other.camera.fx *= 1.01;
  EXPECT_EQ(localisation_difference(other, map.rig), "");
  EXPECT_NE(rig_difference(other, map.rig), "");
  const KeyframeDatabase seen = places_seen_by(other, map);
  ASSERT_EQ(seen.size(), map.places.size());
  for (std::uint32_t k = 0; k < seen.size(); ++k) {
    const PlaceAppearance *a = map.places.find(KeyframeId{k}), *b = seen.find(KeyframeId{k});
    ASSERT_EQ(a == nullptr, b == nullptr);
    for (std::size_t n = 0; a != nullptr && n < a->corners.size(); ++n) {
      const Vector3 ray = map.rig.camera.unproject(a->corners[n].uv.cast<double>());
      EXPECT_LT((other.camera.unproject(b->corners[n].uv.cast<double>()) - ray).norm(), 1e-5);
    }
  }
  other.camera.fx *= 1.05;
  EXPECT_NE(localisation_difference(other, map.rig), "");
  other.kind = map.rig.kind;
  EXPECT_EQ(localisation_difference(other, map.rig), rig_difference(other, map.rig));
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
