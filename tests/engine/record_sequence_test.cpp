#include "engine/logs/record_sequence.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "engine/logs/log_writer.hpp"
#include "tests/io/scratch_folder.hpp"

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
  EXPECT_EQ(writer.finish(), "");
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
  EXPECT_EQ(writer.finish(), "");
  EXPECT_EQ(content(folder / "log.txt"), "first\nlast\n");
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
  EXPECT_NE(file.error().find("log.txt: the disk was too slow; 1005 bytes are lost"), std::string::npos)
      << file.error();
}

TEST(LogFile, AFullDiskIsNamed) {
  const ScratchFolder folder;
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{4096, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  LogFile file(folder / "log.txt");
  file.append(std::string(5000, 'x'));
  file.write_waiting();
  setrlimit(RLIMIT_FSIZE, &before);
  file.append("y");
  file.write_waiting();
  EXPECT_EQ(file.written(), 4096U);
  EXPECT_NE(file.error().find("log.txt: cannot be written: File too large; 905 bytes are lost"),
            std::string::npos)
      << file.error();
  EXPECT_THROW(LogFile(folder / "no/such/folder.txt"), std::runtime_error);
  EXPECT_THROW((void)LogFile::unnamed(folder / "no/such"), std::runtime_error);
}

}  // namespace
}  // namespace twofold
