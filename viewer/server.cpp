// The one file that includes Boost.Beast, which takes long to compile.
#include "viewer/server.hpp"

#include <ifaddrs.h>
#include <net/if.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <exception>
#include <map>
#include <stdexcept>
#include <vector>

#include <fmt/format.h>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include "base/check.hpp"
#include "twofold/viewer.hpp"
#include "viewer/access_control.hpp"
#include "viewer/page_files.hpp"

namespace twofold {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;
using tcp = asio::ip::tcp;
using Clock = std::chrono::steady_clock;
using Error = boost::system::error_code;
using Request = http::request<http::empty_body>;

constexpr std::size_t kConnections = 32;
constexpr std::size_t kViewers = 8;
constexpr std::size_t kHeaderBytes = 8U << 10;
constexpr std::string_view kLivePath = "/live";
constexpr const char* kNoRoom = "as many viewers as there may be are watching";
constexpr std::size_t kMessageBytes = 64;
constexpr auto kUpgradeTime = std::chrono::seconds(5);
constexpr auto kAnswerTime = std::chrono::seconds(30);  // 200 KB through a slow tunnel
constexpr auto kWriteTime = std::chrono::seconds(10);
constexpr auto kLastCall = std::chrono::seconds(3);

/// What the connections share; outlives them.
struct ServerState {
  const ViewScene& scene;
  const ViewTitle& title;
  AccessControl access;
  std::size_t& connections;
  std::chrono::milliseconds request_time;
  ViewSight sight = {};
};

std::string_view field(const Request& request, http::field name) {
  const auto value = request[name];
  return {value.data(), value.size()};
}

AccessRequest access_request(const Request& request) {
  const auto method = request.method_string();
  const auto target = request.target();
  return {{method.data(), method.size()},      {target.data(), target.size()},
          field(request, http::field::host),   field(request, http::field::origin),
          field(request, http::field::cookie), websocket::is_upgrade(request)};
}

/// Counts a connection for as long as it is there.
class ConnectionCount {
 public:
  explicit ConnectionCount(std::size_t& count) : count_(&count) { ++*count_; }
  ConnectionCount(ConnectionCount&& other) noexcept : count_(std::exchange(other.count_, nullptr)) {}
  ConnectionCount& operator=(ConnectionCount&&) = delete;
  ~ConnectionCount() { release(); }
  void release() {
    if (count_ != nullptr) --*count_;
    count_ = nullptr;
  }

 private:
  std::size_t* count_;
};

/// A browser that watches. Reads and writes keep it alive; it ends when both have failed.
class ViewerConnection : public std::enable_shared_from_this<ViewerConnection> {
 public:
  ViewerConnection(ServerState& state, ConnectionCount count, beast::tcp_stream stream)
      : state_(state),
        count_(std::move(count)),
        socket_(std::move(stream)),
        feed_(state.scene, state.title) {}

  void accept(const Request& request) {
    beast::get_lowest_layer(socket_).expires_never();
    socket_.set_option(websocket::stream_base::timeout{kUpgradeTime, std::chrono::seconds(60), true});
    socket_.read_message_max(kMessageBytes);
    socket_.binary(true);
    socket_.async_accept(request, [self = shared_from_this()](Error error) {
      if (error) return self->close();
      self->open_ = true;
      self->read();
      self->write();
    });
  }
  [[nodiscard]] bool is_closed() const { return closed_; }
  [[nodiscard]] ClientFeed& feed() { return feed_; }
  [[nodiscard]] bool is_done() const { return closed_ || (feed_.is_done() && !writing_); }

  /// What is due, unless a message is on its way.
  void write() {
    if (!open_ || closed_) return;
    if (writing_) {
      if (Clock::now() - write_began_ > kWriteTime) close();
      return;
    }
    std::optional<ViewMessage> message = feed_.next(state_.sight);
    if (!message) return;
    writing_ = true;
    write_began_ = Clock::now();
    socket_.text(message->text);
    const auto bytes = message->bytes;
    socket_.async_write(asio::buffer(*bytes), [self = shared_from_this(), bytes](Error error, std::size_t) {
      self->writing_ = false;
      if (error) return self->close();
      self->write();
    });
  }
  /// Nobody was served for so long.
  void excuse(Clock::duration time) { write_began_ += time; }
  void close() {
    closed_ = true;
    Error ignored;
    beast::get_lowest_layer(socket_).socket().close(ignored);
  }

 private:
  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](Error error, std::size_t) {
      if (error || !self->take()) return self->close();
      self->read();
      self->write();
    });
  }
  bool take() {
    const auto bytes = buffer_.data();
    const std::string_view message(static_cast<const char*>(bytes.data()), bytes.size());
    const bool sensible = feed_.take(message, Clock::now());
    buffer_.consume(buffer_.size());
    return sensible;
  }

  ServerState& state_;
  ConnectionCount count_;
  websocket::stream<beast::tcp_stream> socket_;
  ClientFeed feed_;
  beast::flat_buffer buffer_;
  bool open_ = false, closed_ = false, writing_ = false;
  Clock::time_point write_began_;
};

using Viewers = std::vector<std::shared_ptr<ViewerConnection>>;

/// Whose connection it is: the peer's address, or of IPv6 its network, in which anybody has as many as he
/// likes.
asio::ip::address peer_of(const tcp::socket& socket) {
  Error error;
  const tcp::endpoint remote = socket.remote_endpoint(error);
  if (error || remote.address().is_v4()) return remote.address();
  asio::ip::address_v6 address = remote.address().to_v6();
  if (address.is_v4_mapped()) return asio::ip::make_address_v4(asio::ip::v4_mapped, address);
  auto bytes = address.to_bytes();
  std::fill(bytes.begin() + bytes.size() / 2, bytes.end(), std::uint8_t{0});
  return asio::ip::address_v6(bytes);
}

/// Answers one request, or becomes a viewer's connection.
class HttpSession : public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(ServerState& state, Viewers& viewers, tcp::socket socket)
      : state_(state),
        viewers_(viewers),
        peer_(peer_of(socket)),
        count_(state.connections),
        stream_(std::move(socket)) {
    parser_.header_limit(kHeaderBytes);
    parser_.body_limit(0);
  }

  void read() {
    stream_.expires_after(state_.request_time);
    http::async_read(stream_, buffer_, parser_, [self = shared_from_this()](Error error, std::size_t) {
      if (!self->awaits_request_) return;
      self->awaits_request_ = false;
      if (!error) self->answer();
    });
  }
  /// Its request has not come yet.
  [[nodiscard]] bool awaits_request() const { return awaits_request_; }
  [[nodiscard]] const asio::ip::address& peer() const { return peer_; }
  /// Another connection gets its place.
  void drop() {
    awaits_request_ = false;
    count_.release();
    stream_.close();
  }

 private:
  void answer() {
    const Request& request = parser_.get();
    const AccessDecision decision = state_.access.decide(access_request(request));
    switch (decision) {
      case AccessDecision::kBadMethod:
        return refuse(http::status::method_not_allowed, "only GET is answered here");
      case AccessDecision::kBadHost:
        return refuse(http::status::forbidden, "this server does not go by that name");
      case AccessDecision::kBadOrigin:
        return refuse(http::status::forbidden, "pages of other sites may not look");
      case AccessDecision::kNoToken:
        return refuse(http::status::forbidden, "open the address that the program printed, with its token");
      case AccessDecision::kByCookie:
      case AccessDecision::kByToken:
        break;
    }
    const std::string_view target(request.target().data(), request.target().size());
    if (path_of(target) == kLivePath)
      return websocket::is_upgrade(request) ? let_view() : say_whether_there_is_room();
    if (websocket::is_upgrade(request)) return refuse(http::status::not_found, "there is no such socket");
    send_file(decision == AccessDecision::kByToken);
  }

  /// For pages whose socket was refused: a browser does not tell them why.
  void say_whether_there_is_room() {
    if (viewers_.size() >= kViewers) return refuse(http::status::service_unavailable, kNoRoom);
    refuse(http::status::ok, "there is room for a viewer");
  }
  void let_view() {
    if (viewers_.size() >= kViewers) return refuse(http::status::service_unavailable, kNoRoom);
    viewers_.push_back(std::make_shared<ViewerConnection>(state_, std::move(count_), std::move(stream_)));
    viewers_.back()->accept(parser_.get());
  }

  void send_file(bool set_cookie) {
    const std::string_view target(parser_.get().target().data(), parser_.get().target().size());
    const auto files = page_files();
    const auto file = std::find_if(files.begin(), files.end(),
                                   [&](const PageFile& f) { return f.path == path_of(target); });
    if (file == files.end()) return refuse(http::status::not_found, "there is no such file");
    set_head(http::status::ok, file->type);
    response_.set(http::field::content_encoding, "gzip");
    if (set_cookie) response_.set(http::field::set_cookie, state_.access.set_cookie());
    response_.body() = std::string(file->gzip);
    send();
  }
  void refuse(http::status status, const char* why) {
    set_head(status, "text/plain; charset=utf-8");
    response_.body() = std::string(why) + "\n";
    send();
  }
  /// Everything comes from here, nothing is guessed, nobody frames it, nothing is kept.
  void set_head(http::status status, std::string_view type) {
    response_.result(status);
    response_.keep_alive(false);
    response_.set(http::field::content_type, {type.data(), type.size()});
    response_.set("Content-Security-Policy",
                  "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
                  "connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'");
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("X-Frame-Options", "DENY");
    response_.set("Referrer-Policy", "no-referrer");
    response_.set("Cross-Origin-Resource-Policy", "same-origin");
    response_.set("Cross-Origin-Opener-Policy", "same-origin");
    response_.set(http::field::cache_control, "no-store");
  }
  void send() {
    response_.prepare_payload();
    stream_.expires_after(kAnswerTime);
    http::async_write(stream_, response_, [self = shared_from_this()](Error, std::size_t) {
      Error ignored;
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    });
  }

  ServerState& state_;
  Viewers& viewers_;
  const asio::ip::address peer_;
  ConnectionCount count_;
  bool awaits_request_ = true;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{2 * kHeaderBytes};
  http::request_parser<http::empty_body> parser_;
  http::response<http::string_body> response_;
};

/// Sessions whose requests have not come yet, in the order in which they were accepted.
class PendingSessions {
 public:
  void add(const std::shared_ptr<HttpSession>& session) {
    forget_others();
    pending_.push_back(session);
  }

  /// Drops one: of the peer that has most of them, the one that came first, so that nobody who opens many
  /// keeps out, or drives out, somebody else.
  /// @return  false when there is none
  bool drop_one() {
    forget_others();
    std::map<asio::ip::address, std::size_t> connections;
    for (const auto& session : pending_) ++connections[session.lock()->peer()];
    std::shared_ptr<HttpSession> dropped;
    for (const auto& entry : pending_) {
      auto session = entry.lock();
      if (dropped == nullptr || connections[session->peer()] > connections[dropped->peer()])
        dropped = std::move(session);
    }
    if (dropped != nullptr) dropped->drop();
    return dropped != nullptr;
  }

 private:
  void forget_others() {
    std::erase_if(pending_, [](const auto& entry) {
      const auto session = entry.lock();
      return session == nullptr || !session->awaits_request();
    });
  }

  std::vector<std::weak_ptr<HttpSession>> pending_;
};

std::string machine_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

tcp::acceptor listen(asio::io_context& context, const ViewServerOptions& options) {
  TWOFOLD_CHECK(options.invalid_reason().empty(), "server options");
  const auto fail = [&](const Error& error) {
    throw std::runtime_error(fmt::format("{}, port {}: {}", options.bind, options.port, error.message()));
  };
  Error error;
  const auto address = asio::ip::make_address(options.bind, error);
  if (error)
    throw std::runtime_error(
        fmt::format("{}: an address of this machine is needed, such as 127.0.0.1, or 0.0.0.0 for all of them",
                    options.bind));
  const tcp::endpoint endpoint(address, static_cast<std::uint16_t>(options.port));
  tcp::acceptor acceptor(context);
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(asio::socket_base::max_listen_connections, error);
  if (error) fail(error);
  return acceptor;
}

/// Addresses by which others reach the machine, of the family of `any`; link-local ones, which browsers do
/// not take, left out.
std::vector<asio::ip::address> network_addresses(const asio::ip::address& any) {
  std::vector<asio::ip::address> addresses;
  ifaddrs* first = nullptr;
  if (getifaddrs(&first) != 0) return addresses;
  for (const ifaddrs* at = first; at != nullptr; at = at->ifa_next) {
    if (at->ifa_addr == nullptr || (at->ifa_flags & IFF_UP) == 0 || (at->ifa_flags & IFF_LOOPBACK) != 0)
      continue;
    if (at->ifa_addr->sa_family == AF_INET) {
      const auto* ipv4 = reinterpret_cast<const sockaddr_in*>(at->ifa_addr);
      addresses.emplace_back(asio::ip::address_v4(ntohl(ipv4->sin_addr.s_addr)));
    } else if (at->ifa_addr->sa_family == AF_INET6 && any.is_v6()) {
      asio::ip::address_v6::bytes_type bytes;
      std::memcpy(bytes.data(), &reinterpret_cast<const sockaddr_in6*>(at->ifa_addr)->sin6_addr,
                  bytes.size());
      if (const asio::ip::address_v6 ipv6(bytes); !ipv6.is_link_local()) addresses.emplace_back(ipv6);
    }
  }
  freeifaddrs(first);
  return addresses;
}

/// For people: where it listens at all addresses, each of them, the machine's name in the local network, and
/// the one for those who sit before the machine.
std::vector<std::string> printed_addresses(const tcp::endpoint& at, const std::string& token) {
  std::vector<std::string> addresses;
  const auto add = [&](const std::string& host) {
    addresses.push_back(fmt::format("http://{}:{}/?token={}", host, at.port(), token));
  };
  const auto add_address = [&](const asio::ip::address& address) {
    add(address.is_v6() ? "[" + address.to_string() + "]" : address.to_string());
  };
  if (!at.address().is_unspecified()) {
    add_address(at.address());
    return addresses;
  }
  for (const auto& address : network_addresses(at.address())) add_address(address);
  const std::string name = machine_name();
  if (!addresses.empty() && !name.empty()) add(name.substr(0, name.find('.')) + ".local");
  add_address(asio::ip::address_v4::loopback());
  return addresses;
}

void take_lowest_priority() {
  (void)setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), 19);  // never refused
}

}  // namespace

class ViewServer::Impl {
 public:
  Impl(const ViewServerOptions& options, const ViewScene& scene, const ViewTitle& title)
      : acceptor_(listen(context_, options)),
        timer_(context_),
        state_{scene,
               title,
               {secrets_kept_in(options.secrets), acceptor_.local_endpoint().port(), machine_name()},
               connections_,
               options.request_time},
        addresses_(printed_addresses(acceptor_.local_endpoint(), state_.access.token())),
        is_open_to_network_(!acceptor_.local_endpoint().address().is_loopback()) {}

  void run(const std::stop_token& stop, const Tick& tick, const std::function<std::string()>& last_words) {
    take_lowest_priority();
    const Closing closing(*this);
    accept();
    std::optional<Clock::time_point> next_look;
    while (!stop.stop_requested()) {
      serve(next_look.value_or(Clock::now() + (viewers_.empty() ? kNobodyLookPeriod : kLookPeriod)));
      next_look = look_around(tick);
    }
    (void)look_around(tick, true);
    for (const auto& viewer : viewers_) viewer->feed().end(last_words());
    const auto deadline = Clock::now() + kLastCall;
    const auto is_done = [](const auto& viewer) { return viewer->is_done(); };
    while (!std::all_of(viewers_.begin(), viewers_.end(), is_done) && Clock::now() < deadline) {
      for (const auto& viewer : viewers_) viewer->write();
      serve(Clock::now() + kLookPeriod);
    }
  }
  const std::vector<std::string>& addresses() const { return addresses_; }
  int port() const { return port_; }
  bool is_open_to_network() const { return is_open_to_network_; }

 private:
  /// When nobody serves any more, because the run is over or something was thrown: who comes is refused
  /// instead of waiting for an answer, who watched sees the end.
  class Closing {
   public:
    explicit Closing(Impl& impl) : impl_(impl) {}
    Closing(const Closing&) = delete;
    ~Closing() {
      Error error;
      impl_.acceptor_.close(error);
      if (std::uncaught_exceptions() == 0) return;  // they have been told, and may still be reading it
      for (const auto& viewer : impl_.viewers_) viewer->close();
    }

   private:
    Impl& impl_;
  };

  void serve(Clock::time_point end) {
    bool over = false;
    timer_.expires_at(end);
    timer_.async_wait([&over](Error) { over = true; });
    context_.restart();
    while (!over) context_.run_one();
  }

  std::optional<Clock::time_point> look_around(const Tick& tick, bool is_last = false) {
    if (!accepting_) accept();
    std::erase_if(viewers_, [](const auto& viewer) { return viewer->is_closed(); });
    Audience audience{.viewers = viewers_.size(), .is_last = is_last};
    for (const auto& viewer : viewers_) {
      audience.wants_images |= viewer->feed().wants_images();
      for (const ViewCommand command : viewer->feed().take_commands()) audience.commands.push_back(command);
      if (const auto keyframe = viewer->feed().wanted_keyframe()) audience.keyframes.push_back(*keyframe);
    }
    const auto begin = Clock::now();
    const auto next = tick(audience, state_.sight);
    for (const auto& viewer : viewers_) viewer->excuse(Clock::now() - begin);
    for (const auto& viewer : viewers_) viewer->write();
    return next;
  }

  void accept() {
    accepting_ = true;
    acceptor_.async_accept([this](Error error, tcp::socket socket) {
      accepting_ = false;
      if (error) return;  // no file descriptors, perhaps: again at the next tick
      if (connections_ < kConnections || pending_sessions_.drop_one()) {
        socket.set_option(tcp::no_delay(true), error);
        const auto session = std::make_shared<HttpSession>(state_, viewers_, std::move(socket));
        pending_sessions_.add(session);
        session->read();
      }
      accept();
    });
  }

  std::size_t connections_ = 0;  // before the context, whose handlers hold connections until the end
  asio::io_context context_{1};
  tcp::acceptor acceptor_;
  asio::steady_timer timer_;
  ServerState state_;
  Viewers viewers_;
  PendingSessions pending_sessions_;
  const std::vector<std::string> addresses_;
  const int port_ = acceptor_.local_endpoint().port();
  const bool is_open_to_network_;
  bool accepting_ = false;
};

ViewServer::ViewServer(const ViewServerOptions& options, const ViewScene& scene, const ViewTitle& title)
    : impl_(std::make_unique<Impl>(options, scene, title)) {}
ViewServer::~ViewServer() = default;

const std::vector<std::string>& ViewServer::addresses() const {
  return impl_->addresses();
}

int ViewServer::port() const {
  return impl_->port();
}

bool ViewServer::is_open_to_network() const {
  return impl_->is_open_to_network();
}

void ViewServer::run(const std::stop_token& stop, const Tick& tick,
                     const std::function<std::string()>& last_words) {
  impl_->run(stop, tick, last_words);
}

bool has_viewer() {
  return true;
}

}  // namespace twofold
