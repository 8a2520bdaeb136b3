// In the place of zmq_output.cpp where the library is missing.
#include <stdexcept>

#include "streams/zmq_output.hpp"

namespace twofold {

std::unique_ptr<PoseOutput> open_zmq(const std::string& endpoint, PoseForm) {
  throw std::runtime_error("zmq:" + endpoint + ": built without ZeroMQ (libzmq3-dev)");
}

}  // namespace twofold
