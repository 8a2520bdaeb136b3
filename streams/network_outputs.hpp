#pragma once

#include <memory>
#include <string>

#include "streams/pose_output.hpp"

namespace twofold {

/// A datagram a line. Whether anybody listens is unknown to UDP: what the network refuses is counted as
/// missed. @param address  HOST:PORT or [HOST]:PORT
[[nodiscard]] std::unique_ptr<PoseOutput> open_udp(const std::string& address, PoseForm form);

/// Listens on a socket in the file system, which is removed at the end. A reader gets lines from his
/// connection on. An old socket of this path that nobody listens on any more is replaced.
[[nodiscard]] std::unique_ptr<PoseOutput> open_unix(const std::string& path, PoseForm form);

}  // namespace twofold
