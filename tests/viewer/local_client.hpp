#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstring>
#include <string>
#include <utility>

namespace twofold::testing {

/// A connection to a port of this machine that sends what no browser would.
class LocalClient {
 public:
  /// @param from  127.0.0.0/8: all of them are this machine's
  explicit LocalClient(int port, const char* from = "127.0.0.1")
      : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = inet_addr(from);
    (void)::bind(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address);
    address.sin_port = htons(static_cast<std::uint16_t>(port));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = ::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  LocalClient(LocalClient&& other) noexcept
      : socket_(std::exchange(other.socket_, -1)), connected_(other.connected_), closed_(other.closed_) {}
  LocalClient& operator=(LocalClient&&) = delete;
  ~LocalClient() {
    if (socket_ >= 0) ::close(socket_);
  }

  [[nodiscard]] bool connected() const { return connected_; }
  void send(const std::string& bytes) const {
    (void)::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }
  void end_sending() const { ::shutdown(socket_, SHUT_WR); }

  /// What comes until the other side closes, `enough` bytes are there, or nothing came for `patience`.
  [[nodiscard]] std::string receive(std::size_t enough = std::string::npos,
                                    std::chrono::milliseconds patience = std::chrono::seconds(8)) {
    std::string bytes;
    char buffer[65536];
    while (bytes.size() < enough) {
      pollfd ready{socket_, POLLIN, 0};
      if (::poll(&ready, 1, static_cast<int>(patience.count())) <= 0) return bytes;
      const ssize_t n = ::recv(socket_, buffer, sizeof buffer, 0);
      closed_ = n <= 0;
      if (closed_) return bytes;
      bytes.append(buffer, static_cast<std::size_t>(n));
    }
    return bytes;
  }
  /// What comes until `part` is in it, the other side closes, or nothing came for `patience`.
  [[nodiscard]] std::string receive_until(const std::string& part,
                                          std::chrono::milliseconds patience = std::chrono::seconds(8)) {
    std::string bytes;
    while (bytes.find(part) == std::string::npos) {
      const std::string more = receive(1, patience);
      if (more.empty()) break;
      bytes += more;
    }
    return bytes;
  }
  /// The other side has closed; after receive.
  [[nodiscard]] bool closed() const { return closed_; }

 private:
  int socket_;
  bool connected_ = false, closed_ = false;
};

/// A request as a browser writes it.
inline std::string http_request(const std::string& target, const std::string& more = "",
                                const std::string& host = "127.0.0.1:1") {
  std::string request = "GET ";  // appended to: GCC 12 warns of sums of strings here, wrongly
  request.append(target).append(" HTTP/1.1\r\nHost: ").append(host).append("\r\n").append(more);
  return request.append("\r\n");
}

/// Cookie that the token is worth; the token itself, if it is worth none.
inline std::string cookie_for(int port, const std::string& token) {
  LocalClient client(port);
  client.send(http_request("/?token=" + token));
  const std::string answer = client.receive();
  const std::string name = "Set-Cookie: twofold-" + std::to_string(port) + "=";
  const std::size_t at = answer.find(name);
  return at == std::string::npos ? token : answer.substr(at + name.size(), 32);
}

/// What asks for the WebSocket.
inline std::string upgrade_headers() {
  return "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
         "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
}

inline std::string upgrade_request(int port, const std::string& token, const std::string& origin = "",
                                   const std::string& target = "/live") {
  const std::string host = "127.0.0.1:" + std::to_string(port);
  return http_request(target,
                      upgrade_headers() + "Origin: " + (origin.empty() ? "http://" + host : origin) +
                          "\r\nCookie: twofold-" + std::to_string(port) + "=" + cookie_for(port, token) +
                          "\r\n",
                      host);
}

/// A frame of a WebSocket; clients mask theirs.
inline std::string frame(std::uint8_t first, const std::string& payload, bool masked = true) {
  std::string bytes(1, static_cast<char>(first));
  const auto bit = static_cast<std::uint8_t>(masked ? 0x80 : 0);
  if (payload.size() < 126) {
    bytes += static_cast<char>(bit | payload.size());
  } else {
    bytes += static_cast<char>(bit | 126);
    bytes += static_cast<char>(payload.size() >> 8);
    bytes += static_cast<char>(payload.size() & 0xff);
  }
  if (masked) bytes += std::string(4, '\0');
  return bytes + payload;
}
inline std::string text_frame(const std::string& text) {
  return frame(0x81, text);
}

}  // namespace twofold::testing
