#include "streams/line_reader.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <csignal>

#include "tests/streams/numbered_poses.hpp"

namespace twofold {
namespace {

using testing::Heard;
using testing::numbered_pose;

enum class Kind { kPipe, kSocket };

/// Both ends of a pipe or a socket; the reader's does not wait.
class LineReaderTest : public ::testing::TestWithParam<Kind> {
 protected:
  LineReaderTest() {
    // As the writer's thread does it: a pipe without a reader is an error, not the end.
    sigset_t pipe;
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &pipe, nullptr);
    std::array<int, 2> ends{};
    if (GetParam() == Kind::kPipe) {
      EXPECT_EQ(::pipe2(ends.data(), O_CLOEXEC), 0);
    } else {
      EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()), 0);
    }
    theirs_ = FileDescriptor(ends[0]);
    ::fcntl(ends[0], F_SETFL, O_NONBLOCK);
    ours_ = FileDescriptor(ends[1]);
  }

  /// At most `bytes` of what is there.
  std::string read(std::size_t bytes = 1U << 22) {
    std::string text;
    while (text.size() < bytes) {
      const ssize_t size = ::read(theirs_.get(), piece_.data(), std::min(bytes - text.size(), piece_.size()));
      if (size <= 0) break;
      text.append(piece_.data(), static_cast<std::size_t>(size));
    }
    return text;
  }

  std::array<char, 4096>
      piece_{};  // many are read in these tests: a large one would be most of what they cost
  FileDescriptor theirs_, ours_;
};

TEST_P(LineReaderTest, AReaderWhoKeepsUpGetsEveryLine) {
  LineReader reader(std::move(ours_), PoseForm::kJson);
  Heard heard;
  for (int i = 0; i < 2000; ++i) {
    reader.offer(pose_line(numbered_pose(i), PoseForm::kJson));
    heard.take(read());
  }
  EXPECT_EQ(heard.frames.size(), 2000U);
  EXPECT_EQ(heard.missed, 0);
}

TEST_P(LineReaderTest, ADeadReaderHoldsNobodyUpAndIsToldWhatItMissed) {
  constexpr int kLines = 20'000;  // many times what a pipe or a socket holds
  LineReader reader(std::move(ours_), PoseForm::kJson);
  for (int i = 0; i < kLines; ++i) reader.offer(pose_line(numbered_pose(i), PoseForm::kJson));
  EXPECT_FALSE(reader.flush());
  EXPECT_FALSE(reader.gone());
  std::string text = read();
  reader.offer(pose_line(numbered_pose(kLines), PoseForm::kJson));
  text += read();
  Heard heard;
  heard.take(text);
  EXPECT_GT(heard.missed, kLines / 2);
  EXPECT_EQ(static_cast<std::int64_t>(heard.frames.size()) + heard.missed, kLines + 1);
  EXPECT_EQ(heard.frames.back(), kLines);
  EXPECT_TRUE(reader.flush());
}

TEST_P(LineReaderTest, ASlowReaderGetsWholeLinesAndTheRestIsCounted) {
  constexpr int kLines = 5000;
  LineReader reader(std::move(ours_), PoseForm::kJson);
  std::string text;
  for (int i = 0; i < kLines; ++i) {
    reader.offer(pose_line(numbered_pose(i), PoseForm::kJson));
    text += read(200);  // less than a line
  }
  while (!reader.flush()) text += read();
  text += read();
  Heard heard;
  heard.take(text);
  EXPECT_GT(heard.missed, 0);
  EXPECT_EQ(static_cast<std::int64_t>(heard.frames.size()) + heard.missed, kLines);
  EXPECT_TRUE(std::is_sorted(heard.frames.begin(), heard.frames.end()));
}

TEST_P(LineReaderTest, AKilledReaderIsGone) {
  LineReader reader(std::move(ours_), PoseForm::kJson);
  reader.offer(pose_line(numbered_pose(0), PoseForm::kJson));
  theirs_ = FileDescriptor();
  EXPECT_FALSE(reader.gone());
  for (int i = 1; i < 3; ++i) reader.offer(pose_line(numbered_pose(i), PoseForm::kJson));
  EXPECT_TRUE(reader.gone());
}

INSTANTIATE_TEST_SUITE_P(Ends, LineReaderTest, ::testing::Values(Kind::kPipe, Kind::kSocket));

}  // namespace
}  // namespace twofold
