#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "viewer/client_feed.hpp"

namespace twofold {

struct ViewServerOptions {
  std::string bind =
      "127.0.0.1";  ///< address to listen on; others than loopback show the scene to the network
  int port = 0;     ///< in [0, 65535]; 0: any that is free
  std::filesystem::path secrets = {};                                ///< ViewerOptions::secrets
  std::chrono::milliseconds request_time = std::chrono::seconds(5);  ///< for a request to come in, > 0

  /// Empty when valid; otherwise names the field, the rule and the value.
  [[nodiscard]] std::string invalid_reason() const;
};

/// Serves page and scene over HTTP and WebSocket to those who know the token. One thread does everything,
/// that of `run`.
///
/// Bounds: 32 connections, 8 of them viewers; requests of 8 KiB and without a body; request_time for one to
/// come in, 30 s for the answer to go out; messages of a viewer of 64 bytes, and 500 of them a second beside
/// acknowledgements, of which there are no more than messages to it; 10 s for a message to a viewer to go
/// out. What exceeds a bound is refused, or its connection closed. Who comes when there are 32 connections
/// gets the place of one whose request has not come yet: the first one of the address that has most of them.
class ViewServer {
 public:
  /// Listens from here on. Options must be valid. Throws std::runtime_error when the address cannot be had,
  /// or the program was built without the page (no_server.cpp).
  ViewServer(const ViewServerOptions& options, const ViewScene& scene, const ViewTitle& title);
  ~ViewServer();
  ViewServer(const ViewServer&) = delete;
  ViewServer& operator=(const ViewServer&) = delete;

  /// For people: http://127.0.0.1:8420/?token=...
  [[nodiscard]] const std::string& address() const { return addresses().front(); }
  /// All of them, where it listens at every address of the machine.
  [[nodiscard]] const std::vector<std::string>& addresses() const;
  [[nodiscard]] int port() const;
  /// Somebody can be reached who is not at this machine.
  [[nodiscard]] bool is_open_to_network() const;

  struct Audience {
    std::size_t viewers = 0;
    bool wants_images = false;
    bool is_last = false;                       ///< the last call
    std::vector<ViewCommand> commands = {};     ///< since the call before
    std::vector<std::uint32_t> keyframes = {};  ///< whose images viewers wait for
  };
  using Clock = std::chrono::steady_clock;
  /// How often it is called while somebody is looking, and while nobody is.
  static constexpr std::chrono::milliseconds kLookPeriod{10}, kNobodyLookPeriod{100};
  /// Brings the scene up to date.
  /// @return when it wants to be called again; nothing: after one of the periods
  using Tick = std::function<std::optional<Clock::time_point>(const Audience&, ViewSight& newest)>;
  /// At the system's lowest priority, which this thread then keeps. Until a stop is asked for; viewers then
  /// get `last_words()` and what they still lack, for at most three seconds.
  void run(const std::stop_token& stop, const Tick& tick, const std::function<std::string()>& last_words);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace twofold
