#pragma once

#include <memory>
#include <string>

#include "streams/pose_output.hpp"

namespace twofold {

/// A ZeroMQ publisher bound to an endpoint such as tcp://127.0.0.1:5556; a message a line, without its end.
/// Its library drops for subscribers that fall behind; they tell by the frame numbers. Throws
/// std::runtime_error, also when the program was built without the library.
[[nodiscard]] std::unique_ptr<PoseOutput> open_zmq(const std::string& endpoint, PoseForm form);

}  // namespace twofold
