#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numeric>

#include "engine/logs/file_descriptor.hpp"
#include "streams/network_outputs.hpp"
#include "tests/io/scratch_folder.hpp"
#include "tests/io/small_files.hpp"
#include "tests/streams/numbered_poses.hpp"

namespace twofold {
namespace {

using testing::Heard;
using testing::numbered_pose;
using testing::SmallFiles;

std::string line(int frame) {
  return pose_line(numbered_pose(frame), PoseForm::kJson);
}

/// What has arrived.
std::string receive(const FileDescriptor& from) {
  std::string text, some(65536, '\0');
  ssize_t size = 0;
  while ((size = ::recv(from.get(), some.data(), some.size(), MSG_DONTWAIT)) > 0)
    text.append(some, 0, static_cast<std::size_t>(size));
  return text;
}

FileDescriptor connect_to(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
  FileDescriptor fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  EXPECT_EQ(::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  return fd;
}

std::string why_not(const std::string& target) {
  try {
    (void)open_pose_output(target, PoseForm::kJson);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

TEST(PoseOutputs, AFileHasEveryLine) {
  const ScratchFolder folder;
  const auto output = open_pose_output(folder / "poses.jsonl", PoseForm::kJson);
  for (int i = 0; i < 100; ++i) output->offer(line(i));
  EXPECT_TRUE(output->flush());
  std::stringstream text;
  text << std::ifstream(folder / "poses.jsonl").rdbuf();
  Heard heard;
  heard.take(text.str());
  EXPECT_EQ(heard.frames.size(), 100U);
}

TEST(PoseOutputs, ADiskThatIsFullIsSaid) {
  const auto output = open_pose_output("/dev/full", PoseForm::kJson);
  for (int i = 0; i < 3; ++i) output->offer("{}\n");
  EXPECT_FALSE(output->flush());
  EXPECT_EQ(output->problem(), "/dev/full: No space left on device: the last 3 lines are missing");
}

TEST(PoseOutputs, AFileGoesOnWhenThereIsRoomAgainAndEndsWithAWholeLine) {
  const std::string path = ::testing::TempDir() + "full_" + std::to_string(::getpid());
  const std::string line = "{\"frame\": 12345678}\n";
  const auto lines_of = [&] {
    std::ifstream in(path);
    std::vector<std::string> lines;
    for (std::string text; std::getline(in, text);) lines.push_back(text + (in.eof() ? "" : "\n"));
    return lines;
  };
  auto output = open_pose_output(path, PoseForm::kJson);
  {
    const SmallFiles small(3 * line.size() + 5);
    for (int i = 0; i < 6; ++i) output->offer(line);
  }
  EXPECT_EQ(lines_of().size(), 4U) << "the last one is not whole";
  EXPECT_NE(output->problem(), "");
  output->offer(line);
  EXPECT_EQ(output->problem(), "");
  const std::vector<std::string> after = lines_of();
  ASSERT_EQ(after.size(), 6U) << "four, how many were missed, and one more";
  EXPECT_EQ(after[3], line);
  EXPECT_EQ(after[4], missed_line(2, PoseForm::kJson));
  {
    const SmallFiles small(7 * line.size());
    for (int i = 0; i < 6; ++i) output->offer(line);
    output.reset();
  }
  for (const std::string& text : lines_of()) EXPECT_EQ(text.back(), '\n') << text;
  ::unlink(path.c_str());
}

TEST(PoseOutputs, APipeWithANameIsReadByOneAfterTheOther) {
  const ScratchFolder folder;
  const std::string path = folder / "poses.fifo";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  EXPECT_NE(why_not(path).find("nobody reads this pipe"), std::string::npos);
  const auto reader = [&] { return FileDescriptor(::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC)); };
  const auto heard = [](const FileDescriptor& from) {
    Heard lines;
    std::array<char, 4096> bytes{};
    const ssize_t count = ::read(from.get(), bytes.data(), bytes.size());
    lines.take(std::string(bytes.data(), static_cast<std::size_t>(std::max<ssize_t>(0, count))));
    return lines.frames;
  };
  signal(SIGPIPE, SIG_IGN);  // PoseStreams blocks it
  FileDescriptor first = reader();
  const auto output = open_pose_output(path, PoseForm::kJson);
  output->offer(line(0));
  EXPECT_EQ(heard(first), std::vector<std::int64_t>{0});
  first = FileDescriptor();
  for (int i = 1; i < 4; ++i) output->offer(line(i));  // nobody is there
  const FileDescriptor second = reader();
  for (int i = 4; i < 6; ++i) output->offer(line(i));
  EXPECT_EQ(heard(second), (std::vector<std::int64_t>{4, 5})) << "from his coming on";
  EXPECT_EQ(output->problem(), "");
}

TEST(PoseOutputs, ASchemeThatIsNotKnownMakesNoFile) {
  const ScratchFolder folder;
  EXPECT_EQ(
      why_not("foo:bar"),
      "foo:bar: 'foo:' is none of udp:HOST:PORT, unix:PATH, zmq:ENDPOINT; a file of that name is ./foo:bar");
  EXPECT_FALSE(std::filesystem::exists("foo:bar"));
  EXPECT_EQ(why_not(folder / "foo:bar"), "");
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "foo:bar"));
}

TEST(PoseOutputs, UnixReadersComeAndGo) {
  const ScratchFolder folder;
  const std::string path = folder / "poses.socket";
  const auto output = open_pose_output("unix:" + path, PoseForm::kJson);
  output->offer(line(0));
  FileDescriptor first = connect_to(path);
  output->offer(line(1));
  const FileDescriptor second = connect_to(path);
  output->offer(line(2));
  Heard by_first, by_second;
  by_first.take(receive(first));
  first = FileDescriptor();
  for (int i = 3; i < 6; ++i) output->offer(line(i));
  by_second.take(receive(second));
  EXPECT_EQ(by_first.frames, (std::vector<std::int64_t>{1, 2}));
  EXPECT_EQ(by_second.frames, (std::vector<std::int64_t>{2, 3, 4, 5}));
}

TEST(PoseOutputs, OneDeadUnixReaderDoesNotHoldTheOthersUp) {
  const ScratchFolder folder;
  const std::string path = folder / "poses.socket";
  const auto output = open_pose_output("unix:" + path, PoseForm::kJson);
  const FileDescriptor dead = connect_to(path);
  const FileDescriptor alive = connect_to(path);
  Heard heard;
  for (int i = 0; i < 5000; ++i) {
    output->offer(line(i));
    heard.take(receive(alive));
  }
  EXPECT_EQ(heard.frames.size(), 5000U);
  EXPECT_FALSE(output->flush()) << "the dead one's lines are under way for ever";
}

TEST(PoseOutputs, AnAbandonedUnixSocketIsReplacedAndALivingOneIsNot) {
  const ScratchFolder folder;
  const std::string path = folder / "poses.socket";
  {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    const FileDescriptor left(::socket(AF_UNIX, SOCK_STREAM, 0));
    ASSERT_EQ(::bind(left.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  auto output = open_pose_output("unix:" + path, PoseForm::kJson);
  EXPECT_NE(why_not("unix:" + path).find("in use"), std::string::npos);
  output.reset();
  EXPECT_FALSE(std::filesystem::exists(path));
  folder.write("file", "kept");
  EXPECT_NE(why_not("unix:" + (folder / "file")), "");
  EXPECT_TRUE(std::filesystem::exists(folder / "file"));
}

TEST(PoseOutputs, AUnixReaderTooManyIsToldAndGoes) {
  const ScratchFolder folder;
  const std::string path = folder / "poses.socket";
  const auto output = open_pose_output("unix:" + path, PoseForm::kJson);
  std::vector<FileDescriptor> readers;
  for (int i = 0; i < 16; ++i) readers.push_back(connect_to(path));
  output->offer(line(0));
  const FileDescriptor late = connect_to(path);
  output->offer(line(1));
  EXPECT_EQ(receive(late), "{\"error\":\"16 readers are served already\"}\n");
  char byte = 0;
  EXPECT_EQ(::recv(late.get(), &byte, 1, MSG_DONTWAIT), 0) << "the end";
  Heard heard;
  heard.take(receive(readers.back()));
  EXPECT_EQ(heard.frames, (std::vector<std::int64_t>{0, 1}));
  readers.pop_back();
  output->offer(line(2));  // notices
  output->offer(line(3));
  const FileDescriptor next = connect_to(path);
  output->offer(line(4));
  Heard by_next;
  by_next.take(receive(next));
  EXPECT_EQ(by_next.frames, std::vector<std::int64_t>{4}) << "there is a place again";
}

/// Listens on this machine, at the port that is given, or at one that is free.
class UdpListener {
 public:
  explicit UdpListener(std::uint16_t port = 0) : socket_(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    address_.sin_family = AF_INET;
    address_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address_.sin_port = htons(port);
    auto* const address = reinterpret_cast<sockaddr*>(&address_);
    EXPECT_EQ(::bind(socket_.get(), address, sizeof address_), 0);
    socklen_t size = sizeof address_;
    EXPECT_EQ(::getsockname(socket_.get(), address, &size), 0);
  }
  [[nodiscard]] std::uint16_t port() const { return ntohs(address_.sin_port); }
  [[nodiscard]] std::string target() const { return "udp:127.0.0.1:" + std::to_string(port()); }
  [[nodiscard]] FileDescriptor connected() const {
    FileDescriptor socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    EXPECT_EQ(::connect(socket.get(), reinterpret_cast<const sockaddr*>(&address_), sizeof address_), 0);
    return socket;
  }
  [[nodiscard]] Heard heard() const {
    Heard heard;
    heard.take(receive(socket_));
    return heard;
  }
  void leave() { const FileDescriptor closed = std::exchange(socket_, FileDescriptor()); }

 private:
  FileDescriptor socket_;
  sockaddr_in address_{};
};

TEST(PoseOutputs, UdpCountsNothingThatNobodyListenedTo) {
  UdpListener absent;
  absent.leave();
  const auto output = open_pose_output(absent.target(), PoseForm::kJson);
  for (int i = 0; i < 9; ++i) output->offer(line(i));
  const UdpListener listener(absent.port());
  for (int i = 9; i < 12; ++i) output->offer(line(i));
  const Heard heard = listener.heard();
  EXPECT_EQ(heard.missed, 0) << "a count that is wrong is worse than none";
  EXPECT_EQ(heard.frames, (std::vector<std::int64_t>{9, 10, 11})) << "from his coming on";
}

TEST(PoseOutputs, UdpSendsALineADatagram) {
  const UdpListener listener;
  const auto output = open_pose_output(listener.target(), PoseForm::kJson);
  output->miss(3);
  for (int i = 0; i < 4; ++i) output->offer(line(i));
  const Heard heard = listener.heard();
  EXPECT_EQ(heard.frames, (std::vector<std::int64_t>{0, 1, 2, 3}));
  EXPECT_EQ(heard.missed, 3);
}

std::vector<FileDescriptor> sockets_of(const UdpListener& first, const UdpListener& second) {
  std::vector<FileDescriptor> sockets;
  sockets.push_back(first.connected());
  sockets.push_back(second.connected());
  return sockets;
}

TEST(PoseOutputs, UdpFindsWhicheverAddressOfANameIsListenedAt) {
  UdpListener absent;
  absent.leave();
  const UdpListener listener;
  const auto output = udp_output(sockets_of(absent, listener), PoseForm::kJson);
  for (int i = 0; i < 30; ++i) output->offer(line(i));
  std::vector<std::int64_t> all(30);
  std::iota(all.begin(), all.end(), 0);
  EXPECT_EQ(listener.heard().frames, all) << "the line that found nobody at the first address, too";
}

TEST(PoseOutputs, UdpSendsToOneAddressOfANameAsLongAsItIsListenedAt) {
  UdpListener first, second;
  const auto output = udp_output(sockets_of(first, second), PoseForm::kJson);
  for (int i = 0; i < 4; ++i) output->offer(line(i));
  EXPECT_EQ(first.heard().frames, (std::vector<std::int64_t>{0, 1, 2, 3}));
  EXPECT_TRUE(second.heard().frames.empty());
  first.leave();
  for (int i = 4; i < 8; ++i) output->offer(line(i));
  EXPECT_EQ(second.heard().frames, (std::vector<std::int64_t>{4, 5, 6, 7}));
  second.leave();
  for (int i = 8; i < 13; ++i) output->offer(line(i));
  const UdpListener back(first.port());
  for (int i = 13; i < 16; ++i) output->offer(line(i));
  const std::vector<std::int64_t> heard = back.heard().frames;
  ASSERT_GE(heard.size(), 2U);
  EXPECT_EQ(std::vector(heard.end() - 2, heard.end()), (std::vector<std::int64_t>{14, 15})) << "each once";
}

TEST(PoseOutputs, WhatCannotBeOpenedIsNamed) {
  const ScratchFolder folder;
  const std::string pipe = folder / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_NE(why_not(pipe).find("nobody reads this pipe"), std::string::npos) << why_not(pipe);
  EXPECT_NE(why_not("/nowhere/at/all").find("/nowhere/at/all"), std::string::npos);
  EXPECT_NE(why_not("udp:localhost").find("udp:HOST:PORT"), std::string::npos);
  EXPECT_NE(why_not("udp:no.such.host.invalid:1").find("udp:no.such.host.invalid:1"), std::string::npos);
  EXPECT_NE(why_not(std::string("unix:").append(200, 'x')).find("characters"), std::string::npos);
  EXPECT_NE(why_not("zmq:nonsense"), "");
}

}  // namespace
}  // namespace twofold
