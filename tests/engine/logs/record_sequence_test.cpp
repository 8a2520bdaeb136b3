#include "engine/logs/record_sequence.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <future>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "engine/logs/log_writer.hpp"
#include "tests/io/scratch_folder.hpp"
#include "tests/io/small_files.hpp"

namespace twofold {
namespace {

struct Pair {
  std::int64_t number = 0;
  double half = 0;
};

std::string content(const std::string& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// Not even the empty folder's listing tells of the file.
TEST(RecordSequence, ComesBackFromDiskAndCanBeChanged) {
  const ScratchFolder folder;
  const auto file = LogFile::unnamed(folder.path());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  LogWriter writer({file});
  RecordSequence<Pair> records;
  records.keep_in(file);
  constexpr std::size_t kRecords = 100'000;
  for (std::size_t i = 0; i < kRecords; ++i)
    records.push_back({static_cast<std::int64_t>(i), 0.5 * static_cast<double>(i)});
  EXPECT_TRUE(writer.finish().empty());
  records.read_back();
  ASSERT_EQ(records.size(), kRecords);
  records[7].half = 1;
  const RecordSequence<Pair> moved = std::move(records);
  std::int64_t expected = 0;
  for (const Pair& record : moved) {
    ASSERT_EQ(record.number, expected);
    ASSERT_EQ(record.half, expected == 7 ? 1 : 0.5 * static_cast<double>(expected));
    ++expected;
  }
  EXPECT_EQ(moved.back().number, static_cast<std::int64_t>(kRecords - 1));
}

TEST(RecordSequence, OfNothingIsEmpty) {
  const ScratchFolder folder;
  const auto file = LogFile::unnamed(folder.path());
  RecordSequence<Pair> records;
  records.keep_in(file);
  records.read_back();
  EXPECT_TRUE(records.empty());
}

TEST(RecordSequence, KeepsTheNewestWhereMemoryIsAllThereIs) {
  RecordSequence<Pair> records;
  records.keep_newest(1000);
  for (std::int64_t i = 0; i < 10'000; ++i) {
    records.push_back({i, 0});
    EXPECT_EQ(records.back().number, i);
    EXPECT_EQ(static_cast<std::int64_t>(records.forgotten() + records.size()), i + 1);
  }
  EXPECT_GE(records.size(), 1000U);
  EXPECT_LT(records.size(), 1000U + 2 * 256);
  EXPECT_EQ(records.front().number, static_cast<std::int64_t>(records.forgotten()));
}

TEST(LogWriter, WritesSoonWithoutBeingAsked) {
  const ScratchFolder folder;
  const auto file = std::make_shared<LogFile>(folder / "log.txt");
  LogWriter writer({file});
  file->append("first\n");
  for (int turn = 0; turn < 1000 && content(folder / "log.txt").empty(); ++turn)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(content(folder / "log.txt"), "first\n");
  file->append("last\n");
  EXPECT_TRUE(writer.finish().empty());
  EXPECT_EQ(content(folder / "log.txt"), "first\nlast\n");
}

TEST(LogWriter, WhoWaitsForRoomDoesNotWaitForTheNextRound) {
  const auto file = std::make_shared<LogFile>("/dev/null");
  LogWriter writer({file}, {}, std::chrono::hours(1));
  const std::string line(LogFile::kMostWaiting / 2 + 1, 'x');
  constexpr int kTurns = 20;
  const auto appending = std::async(std::launch::async, [&] {
    for (int turn = 0; turn < kTurns; ++turn) {
      EXPECT_TRUE(file->append(line));
      writer.wait_for_room();
      EXPECT_FALSE(file->behind());
    }
  });
  EXPECT_EQ(appending.wait_for(std::chrono::seconds(60)), std::future_status::ready);
  EXPECT_TRUE(writer.finish().empty());
  EXPECT_EQ(file->written(), kTurns * line.size());
}

/// Nobody waits for a thread that is gone, whether it went before or meanwhile; and the run is told.
TEST(LogWriter, WhoWaitsForRoomGoesOnWhenTheThreadHasFailed) {
  const auto file = std::make_shared<LogFile>("/dev/null");
  LogWriter writer({file}, [] { throw std::runtime_error("no memory"); });
  EXPECT_TRUE(file->append(std::string(LogFile::kMostWaiting / 2 + 1, 'x')));
  auto waiting = std::async(std::launch::async, [&] {
    writer.wait_for_room();
    writer.wait_for_room();
  });
  ASSERT_EQ(waiting.wait_for(std::chrono::seconds(20)), std::future_status::ready);
  EXPECT_FALSE(writer.behind()) << "a run without a pace would hold its frames back for ever";
  const std::vector<std::string> lost = writer.finish();
  ASSERT_FALSE(lost.empty());
  EXPECT_EQ(lost.back(), "log writer: no memory");
}

/// Nobody writes: the bound holds, what is beyond it is counted, and nothing later is let in.
TEST(LogFile, LossIsCountedAndNothingFollowsIt) {
  const ScratchFolder folder;
  LogFile file(folder / "log.txt");
  const std::string line(1000, 'x');
  EXPECT_FALSE(file.behind());
  std::size_t appended = 0;
  for (; file.error().empty(); appended += line.size()) file.append(line);
  appended -= line.size();
  EXPECT_TRUE(file.behind());
  EXPECT_LE(appended, LogFile::kMostWaiting);
  EXPECT_GT(appended, LogFile::kMostWaiting - line.size());
  file.write_waiting();
  file.append("later");
  file.write_waiting();
  EXPECT_EQ(std::filesystem::file_size(folder / "log.txt"), appended);
  EXPECT_NE(file.error().find("log.txt: the disk was too slow; 2 records are missing"), std::string::npos)
      << file.error();
}

std::string line_of(int n) {
  return "line " + std::to_string(1000 + n) + "\n";
}

/// The disk takes two and a half lines, then nothing, then everything: the file ends with a whole line at any
/// time, and no line is missing in the end.
TEST(LogFile, AFileOnAFullDiskGoesOnWhenThereIsRoomAgain) {
  const ScratchFolder folder;
  LogFile file(folder / "log.txt", {"lines", true, ""});
  std::string all;
  const auto append = [&](int n) {
    all += line_of(n);
    EXPECT_TRUE(file.append(line_of(n), n));
  };
  {
    const testing::SmallFiles full(2 * line_of(0).size() + 5);
    for (int n = 0; n < 4; ++n) append(n);
    file.write_waiting();
    EXPECT_EQ(content(folder / "log.txt"), line_of(0) + line_of(1)) << "cut back to the last whole line";
    append(4);
    file.write_waiting();
    EXPECT_EQ(file.written(), 2 * line_of(0).size());
    EXPECT_NE(file.error().find("log.txt: File too large; 3 lines wait for room on the disk"),
              std::string::npos)
        << file.error();
    EXPECT_FALSE(file.behind()) << "a run that waited for this disk would wait for ever";
  }
  file.write_waiting();
  append(5);
  file.write_waiting();
  file.give_up();
  EXPECT_EQ(content(folder / "log.txt"), all);
  EXPECT_EQ(file.error(), "");
}

/// Beyond what memory holds, lines are missing, and are named; those after them follow, where lines stand for
/// themselves.
TEST(LogFile, WhatIsLostOnAFullDiskIsNamed) {
  const ScratchFolder folder;
  const std::string line(LogFile::kMostWaiting / 4, 'x');
  for (const bool goes_on : {true, false}) {
    LogFile file(folder / "log.txt", {"lines", goes_on, "so it is"});
    {
      const testing::SmallFiles full(100);
      std::int64_t n = 0;
      for (; n < 2; ++n) EXPECT_TRUE(file.append(line, n * 1'000'000'000));
      file.write_waiting();
      for (; n < 4; ++n) EXPECT_TRUE(file.append(line, n * 1'000'000'000));
      for (; n < 7; ++n) EXPECT_FALSE(file.append(line, n * 1'000'000'000)) << "what waits is bounded";
      EXPECT_NE(file.error().find("log.txt: File too large; 3 lines are missing, from 4.000000000 s to "
                                  "6.000000000 s: so it is; 4 lines wait for room on the disk"),
                std::string::npos)
          << file.error();
    }
    file.write_waiting();
    EXPECT_EQ(file.append("later", 7'000'000'000), goes_on);
    file.write_waiting();
    EXPECT_EQ(std::filesystem::file_size(folder / "log.txt"), 4 * line.size() + (goes_on ? 5 : 0));
  }
}

TEST(LogFile, WhatWaitsInTheEndIsLost) {
  const ScratchFolder folder;
  LogFile file(folder / "log.txt", {"poses", true, ""});
  const testing::SmallFiles full(line_of(0).size() + 1);
  for (int n = 0; n < 3; ++n) file.append(line_of(n), 500'000'000 * n);
  file.write_waiting();
  file.give_up();
  EXPECT_EQ(content(folder / "log.txt"), line_of(0));
  EXPECT_NE(
      file.error().find("log.txt: File too large; 2 poses are missing, from 0.500000000 s to 1.000000000 s"),
      std::string::npos)
      << file.error();
}

TEST(LogFile, AFileThatCannotBeMadeIsAnError) {
  const ScratchFolder folder;
  EXPECT_THROW(LogFile(folder / "no/such/folder.txt"), std::runtime_error);
  EXPECT_THROW((void)LogFile::unnamed(folder / "no/such"), std::runtime_error);
}

}  // namespace
}  // namespace twofold
