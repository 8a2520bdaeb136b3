#include "viewer/server.hpp"

#include <gtest/gtest.h>

#include <cstdlib>
#include <random>
#include <stdexcept>
#include <thread>
#include <vector>

#include "engine/clock.hpp"
#include "tests/viewer/local_client.hpp"
#include "tests/viewer/small_map.hpp"
#include "viewer/keyframe_images.hpp"

namespace twofold {
namespace {

using std::chrono::milliseconds;
using testing::frame;
using testing::http_request;
using testing::LocalClient;
using testing::text_frame;
using testing::upgrade_request;

class ViewServerTest : public ::testing::Test {
 protected:
  /// @param request_time  ViewServerOptions::request_time
  explicit ViewServerTest(milliseconds request_time = milliseconds(1200))
      : server_({.bind = "127.0.0.1", .port = 0, .request_time = request_time}, scene_, title_) {
    scene_.show(testing::small_map(50));
    const std::string& address = server_.address();
    token_ = address.substr(address.find('=') + 1);
    port_ = std::stoi(address.substr(address.rfind(':') + 1));
    thread_ = std::jthread([this](const std::stop_token& stop) {
      server_.run(
          stop,
          [this](const ViewServer::Audience& audience, ViewSight& newest) {
            images_.answer(audience.keyframes, steady_now_ns(), newest);
            return std::nullopt;
          },
          [] { return std::string("over"); });
    });
  }

  [[nodiscard]] std::string answer(const std::string& request) const {
    LocalClient client(port_);
    client.send(request);
    return client.receive();
  }
  [[nodiscard]] bool serves() const {
    return answer(http_request("/?token=" + token_)).starts_with("HTTP/1.1 200");
  }
  /// A viewer that has been greeted.
  [[nodiscard]] LocalClient viewer() const {
    LocalClient client(port_);
    client.send(upgrade_request(port_, token_));
    EXPECT_NE(client.receive(400).find("101 Switching Protocols"), std::string::npos);
    return client;
  }
  /// The server has closed the connection within two seconds.
  static bool is_dropped(LocalClient& client) {
    (void)client.receive(std::string::npos, milliseconds(2000));
    return client.closed();
  }

  ViewScene scene_;
  /// A hundred keyframes have images.
  static ViewedImage image_of(std::uint32_t keyframe) {
    if (keyframe >= 100) throw std::runtime_error("there is none");
    static const std::vector<std::uint8_t> pixels(48, 99);
    return {{pixels.data(), 8, 6, 8}, nullptr};
  }

  ViewTitle title_{.title = "test", .control = true, .keyframe_images = true};
  KeyframeImages images_{image_of};
  ViewServer server_;
  std::string token_;
  int port_ = 0;
  std::jthread thread_;
};

TEST_F(ViewServerTest, ShowsThePageToWhoKnowsTheToken) {
  const std::string page = answer(http_request("/?token=" + token_));
  EXPECT_TRUE(page.starts_with("HTTP/1.1 200 OK"));
  EXPECT_NE(page.find("Set-Cookie: twofold-"), std::string::npos);
  EXPECT_NE(page.find("Content-Security-Policy: default-src 'none'; script-src 'self'"), std::string::npos);
  EXPECT_NE(page.find("frame-ancestors 'none'"), std::string::npos);
  EXPECT_EQ(page.find("Access-Control"), std::string::npos);
  EXPECT_EQ(page.find(token_), std::string::npos) << "the cookie, which other ports get, is not the token";
  const std::string cookie =
      "Cookie: twofold-" + std::to_string(port_) + "=" + testing::cookie_for(port_, token_) + "\r\n";
  EXPECT_GT(answer(http_request("/page.js", cookie)).size(), 50000U);
  EXPECT_TRUE(answer(http_request("/../etc/passwd", cookie)).starts_with("HTTP/1.1 404"));
}

TEST_F(ViewServerTest, RefusesStrangers) {
  for (const std::string& request :
       {http_request("/"), http_request("/page.js"), http_request("/?token=0123"),
        http_request("/?token=" + token_, "", "evil.example"), upgrade_request(port_, "0123"),
        upgrade_request(port_, token_, "http://evil.example"), upgrade_request(port_, token_, "null")})
    EXPECT_TRUE(answer(request).starts_with("HTTP/1.1 403")) << request;
  EXPECT_TRUE(answer("POST /?token=" + token_ + " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 0\r\n\r\n")
                  .starts_with("HTTP/1.1 405"));
}

TEST_F(ViewServerTest, GreetsAViewerAndTellsTheEnd) {
  LocalClient client(port_);
  client.send(upgrade_request(port_, token_));
  const std::string begin = client.receive(4000);
  EXPECT_NE(begin.find("\"hello\""), std::string::npos);
  for (int n = 0; n < 2; ++n) client.send(text_frame("ack"));
  thread_.request_stop();
  const std::string words = "\"message\":\"over\"";
  EXPECT_NE(client.receive_until(words).find(words), std::string::npos);
}

TEST_F(ViewServerTest, DropsWhatIsTooLargeOrBroken) {
  EXPECT_EQ(answer(http_request("/", "X: " + std::string(20000, 'x') + "\r\n")), "");
  EXPECT_EQ(answer("\x16\x03\x01\x02 hello"), "");
  const std::string broken[] = {
      text_frame(std::string(65, 'a')),                                     // longer than any message
      frame(0x81, "ack", false),                                            // not masked
      frame(0x83, "ack"),                                                   // of no known kind
      frame(0xf1, "ack"),                                                   // reserved bits
      text_frame("delete the map"),                                         // no message of ours
      text_frame("\xff\xfe"),                                               // no UTF-8
      frame(0x81, std::string(60000, 'a')),                                 //
      std::string("\x81\xff\x7f\xff\xff\xff\xff\xff\xff\xff\0\0\0\0", 14),  // a length of 2^63
  };
  for (const std::string& bytes : broken) {
    LocalClient client = viewer();
    client.send(bytes);
    EXPECT_TRUE(is_dropped(client)) << bytes.substr(0, 12);
  }
  EXPECT_TRUE(serves());
}

TEST_F(ViewServerTest, DropsWhoSaysTooMuch) {
  LocalClient client = viewer();
  for (int n = 0; n < 1000; ++n) client.send(text_frame("images on"));
  EXPECT_TRUE(is_dropped(client));
}

TEST_F(ViewServerTest, SocketsAreOpenedAtOnePathAlone) {
  for (const char* path : {"/page.js", "/", "/live/", "/live/..", "//live", "/Live", "/parts", "/live%00"})
    EXPECT_TRUE(answer(upgrade_request(port_, token_, "", path)).starts_with("HTTP/1.1 404")) << path;
}

TEST_F(ViewServerTest, GivesOutThePagesFilesAndNothingElse) {
  const std::string cookie =
      "Cookie: twofold-" + std::to_string(port_) + "=" + testing::cookie_for(port_, token_) + "\r\n";
  for (const char* path : {"/", "/page.js", "/page.css", "/icon.svg", "/licences.txt", "/page.js?x=/live"})
    EXPECT_TRUE(answer(http_request(path, cookie)).starts_with("HTTP/1.1 200 OK")) << path;
  EXPECT_NE(answer(http_request("/live?again", cookie)).find("there is room"), std::string::npos)
      << "asked as a page, the socket's path answers in words";
  for (const char* path : {"/live/", "/live/map", "/parts", "/parts/0", "/keyframe/1", "/page.js/",
                           "//page.js", "/%70age.js", "/.", "/live/../page.js", "/map.tfm", "*", "page.js"})
    EXPECT_TRUE(answer(http_request(path, cookie)).starts_with("HTTP/1.1 404")) << path;
  for (const char* path : {"/live", "/parts", "/licences.txt"})
    EXPECT_TRUE(answer(http_request(path)).starts_with("HTTP/1.1 403")) << path << " without a cookie";
}

TEST_F(ViewServerTest, DropsWhoTakesTooLong) {
  LocalClient client(port_);
  client.send("GET / HTTP/1.1\r\n");
  for (int n = 0; n < 15; ++n) {
    std::this_thread::sleep_for(milliseconds(100));
    client.send("X: y\r\n");  // a little at a time
  }
  EXPECT_TRUE(is_dropped(client));
}

TEST_F(ViewServerTest, SurvivesAThousandConnections) {
  LocalClient watching = viewer();
  std::vector<LocalClient> crowd;
  for (int n = 0; n < 1000; ++n) crowd.emplace_back(port_);
  watching.send(frame(0x89, "still there?"));
  EXPECT_NE(watching.receive_until("still there?").find("still there?"), std::string::npos)
      << "who watched before goes on watching";
  crowd.clear();
  std::this_thread::sleep_for(milliseconds(200));
  EXPECT_TRUE(serves());
}

/// Nobody leaves for want of a request.
class PatientViewServerTest : public ViewServerTest {
 protected:
  PatientViewServerTest() : ViewServerTest(std::chrono::hours(1)) {}
};

TEST_F(PatientViewServerTest, WhoSaysNothingKeepsNobodyOut) {
  std::vector<LocalClient> silent;
  for (int n = 0; n < 100; ++n) silent.emplace_back(port_);
  EXPECT_TRUE(serves());
}

/// Who has one connection keeps it, however many somebody else opens, before and after.
TEST_F(ViewServerTest, WhoOpensManyConnectionsDrivesOutHisOwn) {
  std::vector<LocalClient> before, after;
  for (int n = 0; n < 20; ++n) before.emplace_back(port_, "127.0.0.2");
  LocalClient slow(port_);
  const std::string request = http_request("/?token=" + token_);
  slow.send(request.substr(0, 10));
  for (int n = 0; n < 60; ++n) after.emplace_back(port_, "127.0.0.2");
  std::this_thread::sleep_for(milliseconds(200));
  slow.send(request.substr(10));
  EXPECT_TRUE(slow.receive().starts_with("HTTP/1.1 200"));
}

TEST_F(ViewServerTest, EightViewersAtMost) {
  std::vector<LocalClient> viewers;
  for (int n = 0; n < 8; ++n) viewers.push_back(viewer());
  const std::string asks = http_request("/live", "Cookie: twofold-" + std::to_string(port_) + "=" +
                                                     testing::cookie_for(port_, token_) + "\r\n");
  EXPECT_TRUE(answer(upgrade_request(port_, token_)).starts_with("HTTP/1.1 503"));
  EXPECT_NE(answer(asks).find("as many viewers as there may be are watching"), std::string::npos)
      << "in words, which a page cannot read in a socket's answer";
  viewers.clear();
  std::this_thread::sleep_for(milliseconds(300));
  EXPECT_NE(answer(asks).find("there is room"), std::string::npos);
  (void)viewer();
}

/// Bytes of honest conversations, with some of them changed, left out or repeated.
std::string damaged(std::string bytes, std::mt19937& rng) {
  for (int n = static_cast<int>(rng() % 6); n >= 0 && !bytes.empty(); --n) {
    const std::size_t at = rng() % bytes.size();
    switch (rng() % 4) {
      case 0:
        bytes[at] = static_cast<char>(rng());
        break;
      case 1:
        bytes.erase(at, rng() % 20);
        break;
      case 2:
        bytes.insert(at, bytes.substr(rng() % bytes.size(), rng() % 200));
        break;
      default:
        bytes.resize(at);
    }
  }
  return bytes;
}

/// TWOFOLD_FUZZ_SECONDS: how long (default: 3); the sanitizers tell what goes wrong inside.
TEST_F(ViewServerTest, SurvivesDamagedConversations) {
  const char* wanted = std::getenv("TWOFOLD_FUZZ_SECONDS");
  const auto end =
      std::chrono::steady_clock::now() + std::chrono::seconds(wanted != nullptr ? std::atoi(wanted) : 3);
  std::mt19937 rng(7);
  const std::string opening = upgrade_request(port_, token_);
  const std::string page = http_request("/?token=" + token_, "Cookie: twofold-1=0; a=\"b\"\r\n");
  int conversations = 0;
  for (; std::chrono::steady_clock::now() < end; ++conversations) {
    LocalClient client(port_);
    ASSERT_TRUE(client.connected());
    const std::string talk = text_frame("images on") + text_frame("keyframe 17") + text_frame("ack") +
                             text_frame("save map") + frame(0x89, "ping") + frame(0x88, "\x03\xe8");
    const auto kind = rng() % 8;
    if (kind == 0) {
      client.send(damaged(page, rng));
    } else if (kind < 3) {
      client.send(damaged(opening + talk, rng));
    } else {
      client.send(opening);
      client.send(damaged(talk, rng));
    }
    client.end_sending();
    (void)client.receive(200, milliseconds(20));
    if (conversations % 200 == 199) {
      EXPECT_TRUE(serves());
    }
  }
  std::this_thread::sleep_for(milliseconds(300));
  EXPECT_TRUE(serves());
  RecordProperty("conversations", conversations);
}

}  // namespace
}  // namespace twofold
