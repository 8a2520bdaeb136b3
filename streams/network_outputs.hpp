#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/logs/file_descriptor.hpp"
#include "streams/pose_output.hpp"

namespace twofold {

/// A datagram a line. Whether anybody listens is unknown to UDP: what the network refuses is counted as
/// missed. @param address  HOST:PORT or [HOST]:PORT
[[nodiscard]] std::unique_ptr<PoseOutput> open_udp(const std::string& address, PoseForm form);

/// A name may have several addresses (localhost: ::1 and 127.0.0.1), and each can be connected to, whether
/// somebody listens there or not. Lines go to the first until they are refused there, then to the next, and
/// so on round. @param sockets  one connected to each, at least one
[[nodiscard]] std::unique_ptr<PoseOutput> udp_output(std::vector<FileDescriptor> sockets, PoseForm form);

/// Listens on a socket in the file system, which is removed at the end. A reader gets lines from his
/// connection on. An old socket of this path that nobody listens on any more is replaced.
[[nodiscard]] std::unique_ptr<PoseOutput> open_unix(const std::string& path, PoseForm form);

}  // namespace twofold
