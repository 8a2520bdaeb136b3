#include "viewer/access_control.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <stdexcept>

#include <fmt/format.h>

#include "engine/logs/file_descriptor.hpp"

namespace twofold {
namespace {

/// Name or address of "HOST", "HOST:PORT", "[ADDRESS]:PORT"; empty when it is none of these.
std::string_view host_name(std::string_view host) {
  const bool bracketed = host.starts_with('[');
  const std::size_t end = bracketed ? host.find(']') : host.find(':');
  const std::string_view name =
      bracketed ? host.substr(1, end == host.npos ? 0 : end - 1) : host.substr(0, end);
  std::string_view rest = end == host.npos ? std::string_view() : host.substr(bracketed ? end + 1 : end);
  if (rest.empty()) return name;
  const bool is_port = rest.size() > 1 && rest.size() <= 6 && rest[0] == ':' &&
                       std::all_of(rest.begin() + 1, rest.end(), [](char c) { return c >= '0' && c <= '9'; });
  return is_port ? name : std::string_view();
}

bool is_address(std::string_view name) {
  const std::string text(name.substr(0, INET6_ADDRSTRLEN));
  std::array<unsigned char, sizeof(in6_addr)> bytes{};
  return inet_pton(AF_INET, text.c_str(), bytes.data()) == 1 ||
         inet_pton(AF_INET6, text.c_str(), bytes.data()) == 1;
}

/// Value of `name` in "name=value<separator>name=value"; empty when it is not there.
std::string_view value_of(std::string_view list, std::string_view name, char separator) {
  while (!list.empty()) {
    const std::size_t end = std::min(list.find(separator), list.size());
    std::string_view item = list.substr(0, end);
    list.remove_prefix(std::min(end + 1, list.size()));
    item.remove_prefix(std::min(item.find_first_not_of(' '), item.size()));
    if (item.size() > name.size() && item.starts_with(name) && item[name.size()] == '=')
      return item.substr(name.size() + 1);
  }
  return {};
}

/// Takes as long for a near miss as for any other.
bool is_same_secret(std::string_view text, std::string_view secret) {
  if (secret.empty() || text.size() != secret.size()) return false;
  unsigned different = 0;
  for (std::size_t i = 0; i < text.size(); ++i) different |= static_cast<unsigned char>(text[i] ^ secret[i]);
  return different == 0;
}

std::string in_lower_case(std::string_view name) {
  std::string lower(name);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

constexpr std::size_t kSecretDigits = 32;
constexpr std::size_t kFileBytes = 2 * (kSecretDigits + 1);  // two lines

/// Empty when nobody but this user could have read or written it.
std::string why_not_private(const struct stat& status) {
  if (!S_ISREG(status.st_mode)) return "is no file";
  if (status.st_uid != geteuid()) return "belongs to another user";
  if ((status.st_mode & (S_IRWXG | S_IRWXO)) != 0) return "can be read by others: chmod 600";
  return "";
}

bool is_secret(std::string_view line) {
  return line.size() == kSecretDigits && std::all_of(line.begin(), line.end(), [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
         });
}

AccessControl::Secrets secrets_of(const FileDescriptor& file, const std::string& name) {
  struct stat status {};
  if (fstat(file.get(), &status) != 0) throw std::runtime_error(name + ": cannot be read");
  if (const std::string why = why_not_private(status); !why.empty())
    throw std::runtime_error(name + " " + why);
  std::array<char, kFileBytes + 1> bytes{};
  const ssize_t size = read(file.get(), bytes.data(), bytes.size());
  const std::string_view text(bytes.data(), static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  const std::string_view token = text.substr(0, kSecretDigits);
  const std::string_view cookie =
      text.size() == kFileBytes ? text.substr(kSecretDigits + 1, kSecretDigits) : "";
  if (!is_secret(token) || !is_secret(cookie))
    throw std::runtime_error(name + " does not hold a viewer's secrets: remove it, and a new one is made");
  return {std::string(token), std::string(cookie)};
}

}  // namespace

AccessControl::AccessControl(Secrets secrets, int port, std::string_view machine_name)
    : secrets_(std::move(secrets)),
      cookie_name_(fmt::format("twofold-{}", port)),
      machine_name_(in_lower_case(machine_name)) {}

AccessDecision AccessControl::decide(const AccessRequest& request) const {
  if (request.method != "GET") return AccessDecision::kBadMethod;
  if (!is_this_machine(host_name(request.host))) return AccessDecision::kBadHost;
  const bool must_say = request.is_upgrade;
  if ((must_say || !request.origin.empty()) &&
      in_lower_case(request.origin) != in_lower_case(fmt::format("http://{}", request.host)))
    return AccessDecision::kBadOrigin;
  if (is_same_secret(value_of(request.cookie, cookie_name_, ';'), secrets_.cookie))
    return AccessDecision::kByCookie;
  const std::size_t query = std::min(request.target.find('?'), request.target.size());
  const std::string_view parameters = request.target.substr(std::min(query + 1, request.target.size()));
  if (!request.is_upgrade && is_same_secret(value_of(parameters, "token", '&'), secrets_.token))
    return AccessDecision::kByToken;
  return AccessDecision::kNoToken;
}

std::string AccessControl::set_cookie() const {
  return fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict", cookie_name_, secrets_.cookie);
}

/// Addresses are safe: a page of another site can only come here by a name of its own.
bool AccessControl::is_this_machine(std::string_view name) const {
  const std::string asked = in_lower_case(name);  // as browsers write names
  const std::string_view first_label = std::string_view(machine_name_).substr(0, machine_name_.find('.'));
  const bool is_its_name = !first_label.empty() && (asked == machine_name_ || asked == first_label ||
                                                    asked == fmt::format("{}.local", first_label));
  return asked == "localhost" || is_its_name || is_address(name);
}

std::string_view path_of(std::string_view target) {
  return target.substr(0, target.find('?'));
}

std::string random_secret() {
  std::array<unsigned char, 16> bytes{};
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size()))
    throw std::runtime_error("the system gives no random numbers");
  std::string digits;
  for (const unsigned char byte : bytes) digits += fmt::format("{:02x}", byte);
  return digits;
}

AccessControl::Secrets secrets_kept_in(const std::filesystem::path& file) {
  AccessControl::Secrets fresh{random_secret(), random_secret()};
  if (file.empty()) return fresh;
  if (const FileDescriptor made(::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600)); made) {
    const std::string text = fresh.token + "\n" + fresh.cookie + "\n";
    if (::write(made.get(), text.data(), text.size()) == static_cast<ssize_t>(text.size())) return fresh;
    (void)::unlink(file.c_str());  // half of it would be in the way the next time
    throw std::runtime_error(file.string() + ": cannot be written");
  }
  const FileDescriptor kept(::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!kept) throw std::runtime_error(file.string() + ": can neither be made nor read");
  return secrets_of(kept, file.string());
}

}  // namespace twofold
