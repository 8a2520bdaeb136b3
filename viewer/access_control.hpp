#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace twofold {

/// What decides whether a request is answered; header fields are empty when they are missing.
struct AccessRequest {
  std::string_view method, target, host, origin, cookie;
  bool is_upgrade = false;  ///< to a WebSocket
};

enum class AccessDecision : std::uint8_t {
  kByCookie,
  kByToken,    ///< in the address: the answer shall set the cookie
  kBadMethod,  ///< other than GET
  kBadHost,  ///< a name that is not this machine's: somebody's page may have pointed it here (DNS rebinding)
  kBadOrigin,  ///< another site's page asks; browsers always say so when a WebSocket is opened
  kNoToken,    ///< neither token nor cookie, or wrong ones
};

/// Who may look: those who know the token, with a browser that speaks to this very server.
class AccessControl {
 public:
  /// What those send who may look; 32 hexadecimal digits each.
  struct Secrets {
    std::string token;  ///< in the address that is printed
    /// Another one: browsers send cookies to all ports of a host, and whoever listens there need not learn
    /// the address.
    std::string cookie;
  };
  /// @param port  names the cookie, as browsers share them among ports
  /// @param machine_name  with or without its domain
  AccessControl(Secrets secrets, int port, std::string_view machine_name);

  [[nodiscard]] AccessDecision decide(const AccessRequest& request) const;
  [[nodiscard]] const std::string& token() const { return secrets_.token; }
  /// Value of Set-Cookie.
  [[nodiscard]] std::string set_cookie() const;

 private:
  [[nodiscard]] bool is_this_machine(std::string_view host) const;

  Secrets secrets_;
  std::string cookie_name_, machine_name_;
};

/// Target without its query.
[[nodiscard]] std::string_view path_of(std::string_view target);
/// 128 bits of the system's random numbers in hexadecimal digits. Throws std::runtime_error when it has none.
[[nodiscard]] std::string random_secret();
/// New ones; with a file, those in it: it is made when it is not there, readable by its owner alone. Throws
/// std::runtime_error naming the file: others may read it, it is somebody else's, or holds something else.
[[nodiscard]] AccessControl::Secrets secrets_kept_in(const std::filesystem::path& file);

}  // namespace twofold
