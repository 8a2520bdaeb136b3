#include "streams/zmq_output.hpp"

#include <zmq.h>

#include <stdexcept>
#include <string_view>

#include "streams/port.hpp"

namespace twofold {
namespace {

constexpr int kQueued = 256;    // messages a subscriber may be behind
constexpr int kLingerMs = 500;  // at the end, for those under way

class ZmqOutput final : public PoseOutput {
 public:
  ZmqOutput(const std::string& endpoint, PoseForm form)
      : context_(zmq_ctx_new()), socket_(zmq_socket(context_, ZMQ_PUB)), form_(form) {
    zmq_setsockopt(socket_, ZMQ_SNDHWM, &kQueued, sizeof kQueued);
    zmq_setsockopt(socket_, ZMQ_LINGER, &kLingerMs, sizeof kLingerMs);
    if (zmq_bind(socket_, endpoint.c_str()) == 0) return;
    const std::string why = zmq_strerror(zmq_errno());
    close();
    throw std::runtime_error("zmq:" + endpoint + ": " + why);
  }
  ~ZmqOutput() override { close(); }
  ZmqOutput(const ZmqOutput&) = delete;
  ZmqOutput& operator=(const ZmqOutput&) = delete;

  void offer(const std::string& lines) override {
    if (missed_ > 0 && send(missed_line(missed_, form_))) missed_ = 0;
    if (!send(lines)) ++missed_;
  }
  void miss(std::uint64_t lines) override { missed_ += lines; }

 private:
  bool send(std::string_view line) {
    return zmq_send(socket_, line.data(), line.size() - 1, ZMQ_DONTWAIT) >= 0;
  }
  void close() {
    zmq_close(socket_);
    zmq_ctx_term(context_);
  }

  void* context_;
  void* socket_;
  PoseForm form_;
  std::uint64_t missed_ = 0;
};

}  // namespace

std::unique_ptr<PoseOutput> open_zmq(const std::string& endpoint, PoseForm form) {
  if (endpoint.find("://") == std::string::npos)
    throw std::runtime_error("zmq:" + endpoint + ": the form is zmq:tcp://HOST:PORT or zmq:ipc://PATH");
  if (is_beyond_ports(endpoint.substr(endpoint.rfind(':') + 1)))  // all of it, where there is no colon
    throw std::runtime_error("zmq:" + endpoint + ": a port is 65535 at most");
  return std::make_unique<ZmqOutput>(endpoint, form);
}

}  // namespace twofold
