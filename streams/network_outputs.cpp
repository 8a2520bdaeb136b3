#include "streams/network_outputs.hpp"

#include <netdb.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>

#include "streams/line_reader.hpp"
#include "streams/port.hpp"

namespace twofold {
namespace {

constexpr std::size_t kMaxReaders = 16;

[[noreturn]] void fail(const std::string& target, const std::string& why) {
  throw std::runtime_error(target + ": " + why);
}

class UdpOutput final : public PoseOutput {
 public:
  UdpOutput(std::vector<FileDescriptor> sockets, PoseForm form) : sockets_(std::move(sockets)), form_(form) {}

  /// A line that cannot be sent is gone, as those are that are lost on the way: an error says as often as not
  /// that nobody listened to the line before.
  void offer(const std::string& lines) override {
    if (missed_ > 0 && send(missed_line(missed_, form_))) missed_ = 0;
    (void)send(lines);
    last_ = lines;
  }
  void miss(std::uint64_t lines) override { missed_ += lines; }

 private:
  bool send(const std::string& lines) {
    for (std::size_t refusals = 0; refusals <= sockets_.size(); ++refusals) {
      if (send_once(lines)) return true;
      if (errno != ECONNREFUSED && errno != ENETUNREACH && errno != EHOSTUNREACH) return false;
      try_next_address();
    }
    return false;
  }
  bool send_once(const std::string& lines) {
    return ::send(sockets_[at_].get(), lines.data(), lines.size(), MSG_DONTWAIT | MSG_NOSIGNAL) >= 0;
  }
  /// What was refused is the line before, which nobody has had: it is sent again.
  void try_next_address() {
    if (sockets_.size() == 1) return;
    at_ = (at_ + 1) % sockets_.size();
    if (!last_.empty()) (void)send_once(last_);
  }

  std::vector<FileDescriptor> sockets_;  // each connected to another address of one name
  std::size_t at_ = 0;                   // where lines go, until nobody listens there
  PoseForm form_;
  std::uint64_t missed_ = 0;
  std::string last_;
};

class UnixOutput final : public PoseOutput {
 public:
  UnixOutput(FileDescriptor listening, std::string path, PoseForm form)
      : listening_(std::move(listening)), path_(std::move(path)), form_(form) {}
  ~UnixOutput() override { ::unlink(path_.c_str()); }

  void offer(const std::string& lines) override {
    welcome();
    for (LineReader& reader : readers_) reader.offer(lines);
    std::erase_if(readers_, [](const LineReader& reader) { return reader.gone(); });
  }
  void miss(std::uint64_t lines) override {
    for (LineReader& reader : readers_) reader.miss(lines);
  }
  bool flush() override {
    bool done = true;
    for (LineReader& reader : readers_) done &= reader.flush() || reader.gone();
    return done;
  }

 private:
  void welcome() {
    for (;;) {
      FileDescriptor connection(::accept4(listening_.get(), nullptr, nullptr, SOCK_CLOEXEC));
      if (!connection) return;
      LineReader& reader = readers_.emplace_back(std::move(connection), form_);
      if (readers_.size() <= kMaxReaders) continue;
      reader.offer(error_line(fmt::format("{} readers are served already", kMaxReaders), form_));
      readers_.pop_back();  // which closes it
    }
  }

  FileDescriptor listening_;
  std::string path_;
  PoseForm form_;
  std::vector<LineReader> readers_;
};

sockaddr_un unix_address(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path)
    fail(fmt::format("unix:{}", path),
         fmt::format("a path of 1 to {} characters is needed", sizeof address.sun_path - 1));
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

/// A socket that was left behind by a process that is gone.
bool is_abandoned(const std::string& path, const sockaddr_un& address) {
  struct stat found {};
  if (::lstat(path.c_str(), &found) != 0 || !S_ISSOCK(found.st_mode)) return false;
  const FileDescriptor probe(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  const auto* to = reinterpret_cast<const sockaddr*>(&address);
  return ::connect(probe.get(), to, sizeof address) != 0 && errno == ECONNREFUSED;
}

}  // namespace

std::unique_ptr<PoseOutput> open_udp(const std::string& address, PoseForm form) {
  const std::string target = "udp:" + address;
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos || colon == 0) fail(target, "must be udp:HOST:PORT");
  if (is_beyond_ports(address.substr(colon + 1))) fail(target, "a port is 65535 at most");
  std::string host = address.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') host = host.substr(1, host.size() - 2);
  addrinfo hints{};
  hints.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  if (const int error = ::getaddrinfo(host.c_str(), address.c_str() + colon + 1, &hints, &found))
    fail(target, ::gai_strerror(error));
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> list(found, &::freeaddrinfo);
  std::vector<FileDescriptor> sockets;
  for (const addrinfo* at = found; at != nullptr; at = at->ai_next) {
    FileDescriptor socket(::socket(at->ai_family, SOCK_DGRAM | SOCK_CLOEXEC, 0));
    if (socket && ::connect(socket.get(), at->ai_addr, at->ai_addrlen) == 0)
      sockets.push_back(std::move(socket));
  }
  if (sockets.empty()) fail(target, std::strerror(errno));
  return udp_output(std::move(sockets), form);
}

std::unique_ptr<PoseOutput> udp_output(std::vector<FileDescriptor> sockets, PoseForm form) {
  return std::make_unique<UdpOutput>(std::move(sockets), form);
}

std::unique_ptr<PoseOutput> open_unix(const std::string& path, PoseForm form) {
  const sockaddr_un address = unix_address(path);
  if (is_abandoned(path, address)) ::unlink(path.c_str());
  FileDescriptor listening(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!listening ||
      ::bind(listening.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listening.get(), kMaxReaders) != 0)
    fail("unix:" + path, std::strerror(errno));
  return std::make_unique<UnixOutput>(std::move(listening), path, form);
}

}  // namespace twofold
