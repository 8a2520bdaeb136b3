#pragma once

#include <cstdint>
#include <string>

#include "engine/logs/file_descriptor.hpp"
#include "streams/pose_lines.hpp"

namespace twofold {

/// Somebody who reads lines at the other end of a file, pipe, terminal or stream socket, at his own pace.
/// Lines are whole or missing; who missed some is told how many before the next one. Never waits. A full disk
/// is a reader who does not read at present.
class LineReader {
 public:
  /// The file descriptor must be in the writer's hands alone: what poll says holds until it is written to.
  LineReader(FileDescriptor fd, PoseForm form);
  /// Cuts a file back to its last whole line.
  ~LineReader();
  LineReader(LineReader&&) = default;
  LineReader& operator=(LineReader&&) = default;

  /// Takes whole lines, or counts them as missed when the reader has not taken those before.
  void offer(const std::string& lines);
  void miss(std::uint64_t lines) { missed_ += lines; }
  /// Hands over what is left of the lines taken before, and how many were missed. True when nothing is left.
  bool flush();
  /// The other end is closed, or broken.
  [[nodiscard]] bool gone() const { return gone_; }
  /// Why lines are missing that nobody has been told of, as of a disk that is full: one sentence, or nothing.
  [[nodiscard]] std::string problem() const;

 private:
  bool send_pending();
  /// Bytes that went out; 0: none would at present.
  [[nodiscard]] std::size_t write_some(const char* bytes, std::size_t count);

  FileDescriptor fd_;
  PoseForm form_;
  bool socket_ = false;
  bool file_ = false;      // a regular one
  int error_ = 0;          // errno of the last write that failed; 0: it did not
  std::size_t begun_ = 0;  // bytes of a line that is not whole yet
  std::size_t chunk_ = 0;  // bytes that a write never waits with, when poll says that there is room
  std::string pending_;
  std::uint64_t missed_ = 0;
  bool gone_ = false;
};

}  // namespace twofold
