#include "engine/logs/schedule_log.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <limits>
#include <random>
#include <sstream>

#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

void append_all(const Schedule& schedule, ScheduleStreams& streams) {
  if (schedule.input) streams.note_input(*schedule.input);
  for (const auto& step : schedule.tracker) streams.tracker.append(step);
  for (const auto& step : schedule.mapper) streams.mapper.append(step);
  for (const auto& step : schedule.loop_closer) streams.loop_closer.append(step);
}

std::vector<std::uint8_t> bytes_of(const Schedule& schedule) {
  ScheduleStreams streams;
  append_all(schedule, streams);
  std::ostringstream out;
  EXPECT_TRUE(write_schedule(out, streams));
  const std::string text = out.str();
  return {text.begin(), text.end()};
}

/// A run as it might have been: versions grow every few frames, some frames are dropped or degraded.
Schedule plausible(int frames, unsigned seed) {
  std::mt19937 rng(seed);
  const auto below = [&](std::uint32_t n) { return static_cast<std::uint32_t>(rng()) % n; };
  const auto one_in = [&](std::uint32_t n) { return below(n) == 0; };
  Schedule s;
  if (frames > 0) s.input = {0x0123456789abcdef, 0xfedcba9876543210 + seed};
  std::uint64_t version = 1;
  for (int i = 0; i < frames; ++i) {
    if (one_in(6)) {
      ++version;
      s.mapper.push_back({version, 1 + below(2), one_in(50) ? 1U : 0U});
      s.loop_closer.push_back(
          {version - below(2), static_cast<std::int64_t>(version), one_in(30) ? 1U : 0U, 0});
    }
    TrackerStep step{i, version, TrackerStep::Fate::kTracked, 0, one_in(40) ? 1U : 0U};
    if (one_in(20)) step.effort_level = static_cast<std::uint8_t>(below(16));
    step.keyframe_withheld = one_in(30);
    if (one_in(25)) step = {i, 0, TrackerStep::Fate::kDropped, 0, 0};
    s.tracker.push_back(step);
  }
  return s;
}

TEST(ScheduleLog, ReadsBackWhatWasWritten) {
  for (const int frames : {0, 1, 2000}) {
    const Schedule schedule = plausible(frames, 11);
    const auto parsed = parse_schedule(bytes_of(schedule));
    ASSERT_TRUE(parsed) << parsed.error();
    EXPECT_EQ(*parsed, schedule);
  }
}

TEST(ScheduleLog, ReadsBackExtremes) {
  constexpr auto kMost32 = std::numeric_limits<std::uint32_t>::max();
  constexpr auto kMost64 = std::numeric_limits<std::uint64_t>::max();
  constexpr auto kMostFrame = std::numeric_limits<std::int64_t>::max();
  Schedule s;
  s.tracker = {{0, kMost64, TrackerStep::Fate::kTracked, 15, kMost32, true},
               {kMostFrame, 0, TrackerStep::Fate::kDropped, 0, 1}};
  s.mapper = {{kMost64, kMost32, kMost32}, {0, 0, 0}};
  s.loop_closer = {{kMost64, kMostFrame, kMost32, kMost32}, {0, -1, 0, 0}};
  const auto parsed = parse_schedule(bytes_of(s));
  ASSERT_TRUE(parsed) << parsed.error();
  EXPECT_EQ(*parsed, s);
}

TEST(ScheduleLog, TakesAFewBytesAFrame) {
  ScheduleStreams streams;
  append_all(plausible(10'000, 2), streams);
  EXPECT_LT(static_cast<double>(streams.tracker.bytes().size()) / 10'000, 3.5);
}

/// The steps of a thread are those of the whole schedule, up to where it ends.
template <class Step>
void expect_begins(const std::vector<Step>& whole, const std::vector<Step>& part) {
  ASSERT_LE(part.size(), whole.size());
  EXPECT_TRUE(std::equal(part.begin(), part.end(), whole.begin()));
}

/// Refused, or what there is of the schedule, known not to be all of it.
void expect_refused_or_unended(std::span<const std::uint8_t> file, const Schedule& whole,
                               const std::string& what) {
  SCOPED_TRACE(what);
  const auto parsed = parse_schedule(file);
  if (!parsed) return;
  EXPECT_FALSE(parsed->ended);
  expect_begins(whole.tracker, parsed->tracker);
  expect_begins(whole.mapper, parsed->mapper);
  expect_begins(whole.loop_closer, parsed->loop_closer);
}

TEST(ScheduleLog, NoTruncationAndNoChangedByteIsTakenForAWholeSchedule) {
  const Schedule whole = plausible(60, 5);
  const auto good = bytes_of(whole);
  for (std::size_t length = 0; length < good.size(); ++length)
    expect_refused_or_unended(std::span(good).first(length), whole, std::to_string(length) + " bytes");
  for (std::size_t at = 0; at < good.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      auto bad = good;
      bad[at] ^= static_cast<std::uint8_t>(1 << bit);
      expect_refused_or_unended(bad, whole, "bit " + std::to_string(bit) + " of byte " + std::to_string(at));
    }
  }
  EXPECT_FALSE(parse_schedule(std::span(good).first(100)));  // within a section of many records
  auto longer = good;
  longer.push_back(0);
  EXPECT_FALSE(parse_schedule(longer));
}

TEST(ScheduleLog, ErrorsNameTheSection) {
  constexpr int kEndBytes = 7, kInputBytes = 3 + 16 + 4;
  const Schedule schedule = plausible(400, 5);
  const auto good = bytes_of(schedule);
  const auto error = [](std::vector<std::uint8_t> bytes) {
    const auto parsed = parse_schedule(bytes);
    return parsed ? std::string("accepted") : parsed.error();
  };
  EXPECT_NE(error({'h', 'e', 'l', 'l', 'o'}).find("no schedule log"), std::string::npos);
  auto other = good;
  other.at(8) = 9;
  EXPECT_NE(error(other).find("format version 9"), std::string::npos) << error(other);
  auto damaged = good;
  damaged.at(20) ^= 1;
  EXPECT_NE(error(damaged).find("section 'tracker'"), std::string::npos) << error(damaged);
  damaged = good;
  damaged[good.size() - 1 - kEndBytes] ^= 1;
  EXPECT_NE(error(damaged).find("section 'input' is damaged"), std::string::npos) << error(damaged);
  damaged = good;
  damaged[good.size() - 1 - kInputBytes - kEndBytes] ^= 1;
  EXPECT_NE(error(damaged).find("section 'loop closer' is damaged"), std::string::npos) << error(damaged);
  const std::vector<std::uint8_t> cut(good.begin(), good.end() - kInputBytes - kEndBytes - 2);
  EXPECT_NE(error(cut).find("section 'loop closer'"), std::string::npos) << error(cut);
  std::vector<std::uint8_t> twice(good.begin(), good.end() - kEndBytes);
  twice.insert(twice.end(), good.end() - kInputBytes - kEndBytes, good.end());
  EXPECT_NE(error(twice).find("section 'input' is there twice"), std::string::npos) << error(twice);
}

TEST(ScheduleLog, OversizedCountsAreRefusedBeforeMemoryIsTaken) {
  const std::string header("TWFSCHED\5\1");
  std::vector<std::uint8_t> file(header.begin(), header.end());
  file.reserve(64);
  for (int i = 0; i < 2; ++i) {  // 2^63 - 1 records in as many bytes
    for (int k = 0; k < 8; ++k) file.push_back(0xFF);
    file.push_back(0x7F);
  }
  const auto parsed = parse_schedule(file);
  ASSERT_FALSE(parsed);
  EXPECT_NE(parsed.error().find("section 'tracker' is longer than the file"), std::string::npos)
      << parsed.error();
}

TEST(ScheduleLog, FramesOutOfOrderAreRefused) {
  Schedule schedule = plausible(10, 1);
  std::swap(schedule.tracker[3], schedule.tracker[7]);
  const auto parsed = parse_schedule(bytes_of(schedule));
  ASSERT_FALSE(parsed);
  EXPECT_NE(parsed.error().find("frames out of order"), std::string::npos) << parsed.error();
}

/// Refused with a reason, known to lack its end, or a log that can be written again.
TEST(ScheduleLog, RandomBytesAreRefusedOrALog) {
  std::mt19937 rng(17);
  const auto good = bytes_of(plausible(30, 3));
  int refused = 0;
  for (int i = 0; i < 20'000; ++i) {
    auto bytes = good;
    bytes.resize(rng() % (good.size() + 40), 0);
    const std::size_t keep = rng() % 12;  // often the magic survives
    for (std::size_t at = keep; at < bytes.size(); ++at) {
      if (rng() % 4 == 0) bytes[at] = static_cast<std::uint8_t>(rng());
    }
    const auto parsed = parse_schedule(bytes);
    if (parsed) {
      auto again = parse_schedule(bytes_of(*parsed));
      ASSERT_TRUE(again);
      again->ended = parsed->ended;
      EXPECT_EQ(again, parsed);
      refused += !parsed->ended;
      continue;
    }
    ++refused;
    EXPECT_EQ(parsed.error().find("schedule log: "), 0U) << parsed.error();
    EXPECT_GT(parsed.error().size(), std::string("schedule log: ").size());
  }
  EXPECT_GT(refused, 19'000);
}

/// A schedule that went to a file record by record, as a run goes on.
class GrowingScheduleLog : public ::testing::Test {
 protected:
  [[nodiscard]] std::vector<std::uint8_t> bytes() const {
    file_->write_waiting();
    std::ifstream in(folder_ / "schedule.log", std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }

  ScratchFolder folder_;
  std::shared_ptr<LogFile> file_ = std::make_shared<LogFile>(folder_ / "schedule.log");
};

TEST_F(GrowingScheduleLog, IsWholeUpToTheLastRecordWheneverItIsCutOff) {
  const Schedule schedule = plausible(60, 5);
  ScheduleStreams streams;
  streams.keep_in(file_);
  append_all(schedule, streams);
  const auto grown = bytes();
  std::size_t longest = 0;
  for (std::size_t length = 9; length <= grown.size(); ++length) {
    const auto parsed = parse_schedule(std::span(grown).first(length));
    ASSERT_TRUE(parsed) << length << ": " << parsed.error();
    EXPECT_FALSE(parsed->ended);
    expect_begins(schedule.tracker, parsed->tracker);
    EXPECT_GE(parsed->tracker.size(), longest);
    longest = parsed->tracker.size();
  }
  EXPECT_EQ(longest, schedule.tracker.size());
  ScheduleStreams::end(*file_);
  const auto parsed = parse_schedule(bytes());
  ASSERT_TRUE(parsed) << parsed.error();
  EXPECT_EQ(*parsed, schedule);
}

TEST_F(GrowingScheduleLog, MergesToTheBytesOfOneKeptInMemory) {
  const Schedule schedule = plausible(200, 6);
  ScheduleStreams streams;
  streams.keep_in(file_);
  append_all(schedule, streams);
  const auto unended = merge_schedule(bytes());
  ASSERT_TRUE(unended) << unended.error();
  EXPECT_FALSE(parse_schedule(*unended)->ended);
  ScheduleStreams::end(*file_);
  EXPECT_EQ(merge_schedule(bytes()), bytes_of(schedule));
  auto damaged = bytes();
  damaged[40] ^= 1;
  EXPECT_FALSE(merge_schedule(damaged));
}

TEST(ScheduleLog, StreamsInAndOut) {
  const Schedule schedule = plausible(100, 4);
  const auto bytes = bytes_of(schedule);
  std::istringstream in(std::string(bytes.begin(), bytes.end()));
  const auto parsed = read_schedule(in);
  ASSERT_TRUE(parsed) << parsed.error();
  EXPECT_EQ(*parsed, schedule);
  std::ostringstream broken;
  broken.setstate(std::ios::badbit);
  EXPECT_FALSE(write_schedule(broken, ScheduleStreams()));
}

}  // namespace
}  // namespace twofold
