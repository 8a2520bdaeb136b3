#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "streams/pose_lines.hpp"

namespace twofold {

/// Where lines go. One thread; no call waits for whoever reads. A regular file is written at the speed of its
/// disk: one that hangs, as of a network that is gone, holds up the other outputs and the end of the run, but
/// never the tracker.
class PoseOutput {
 public:
  virtual ~PoseOutput() = default;
  /// One or more whole lines; not empty.
  virtual void offer(const std::string& lines) = 0;
  /// Lines that were lost on the way here: readers are told with the next line.
  virtual void miss(std::uint64_t lines) = 0;
  /// Tries to hand over what is under way. True when nothing is left, or nobody who could take it.
  virtual bool flush() { return true; }
  /// What readers will never know by themselves, as that a disk is full: one sentence, or nothing.
  [[nodiscard]] virtual std::string problem() const { return ""; }
};

/// @param target  "-": standard output; udp:HOST:PORT; unix:PATH, a socket that 16 readers at a time may
///                connect to and leave, others are told that they are too many; zmq:ENDPOINT, which publishes
///                there; else a file, or a pipe with a name, that somebody reads; when he
///                leaves, another one may come. A file whose name has a colon before any slash is "./a:b"
///
/// Throws std::runtime_error naming the target and what is wrong with it.
[[nodiscard]] std::unique_ptr<PoseOutput> open_pose_output(const std::string& target, PoseForm form);

}  // namespace twofold
