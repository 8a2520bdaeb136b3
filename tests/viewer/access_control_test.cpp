#include "viewer/access_control.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>

#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

const std::string kSecret = "00112233445566778899aabbccddeeff";
const std::string kCookie = "ffeeddccbbaa99887766554433221100";

class AccessControlTest : public ::testing::Test {
 protected:
  [[nodiscard]] AccessDecision page(const std::string& target, const std::string& host = "127.0.0.1:8420",
                                    const std::string& origin = "", const std::string& cookie = "") const {
    return access_.decide({"GET", target, host, origin, cookie, false});
  }
  [[nodiscard]] AccessDecision socket(const std::string& origin, const std::string& cookie,
                                      const std::string& host = "127.0.0.1:8420") const {
    return access_.decide({"GET", "/live?token=" + kSecret, host, origin, cookie, true});
  }

  AccessControl access_{{kSecret, kCookie}, 8420, "Robot.lab.example"};
  const std::string cookie_ = "twofold-8420=" + kCookie;
};

TEST_F(AccessControlTest, TokenOpensThePageAndCookieTheRest) {
  EXPECT_EQ(page("/?token=" + kSecret), AccessDecision::kByToken);
  EXPECT_EQ(page("/?a=b&token=" + kSecret), AccessDecision::kByToken);
  EXPECT_EQ(page("/page.js", "127.0.0.1:8420", "", "other=1; " + cookie_), AccessDecision::kByCookie);
  EXPECT_EQ(socket("http://127.0.0.1:8420", cookie_), AccessDecision::kByCookie);
}

TEST(ViewSecrets, AreKeptInAFileOfTheOwnersAlone) {
  const ScratchFolder folder;
  const auto file = folder.path() / "secrets";
  const AccessControl::Secrets first = secrets_kept_in(file);
  EXPECT_EQ(first.token.size(), 32U);
  EXPECT_NE(first.token, first.cookie);
  const AccessControl::Secrets again = secrets_kept_in(file);
  EXPECT_EQ(again.token, first.token);
  EXPECT_EQ(again.cookie, first.cookie);
  EXPECT_EQ(std::filesystem::status(file).permissions() & std::filesystem::perms::mask,
            std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
  EXPECT_NE(secrets_kept_in({}).token, secrets_kept_in({}).token) << "without a file each time others";
}

TEST(ViewSecrets, AFileThatWillNotDoIsRefused) {
  const ScratchFolder folder;
  const auto file = folder.path() / "secrets";
  (void)secrets_kept_in(file);
  const auto expect_refused = [](const std::filesystem::path& refused, const char* part) {
    try {
      (void)secrets_kept_in(refused);
      ADD_FAILURE() << refused;
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find(part), std::string::npos) << error.what();
    }
  };
  std::filesystem::permissions(file, std::filesystem::perms::group_read, std::filesystem::perm_options::add);
  expect_refused(file, "read by others");
  for (const char* content : {"", "00112233445566778899aabbccddeeff\n", "secret\nsecret\n"}) {
    folder.write("other", content);
    std::filesystem::permissions(folder.path() / "other",
                                 std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    expect_refused(folder.path() / "other", "secrets");
  }
  std::filesystem::create_symlink(file, folder.path() / "link");
  expect_refused(folder.path() / "link", "neither");
  expect_refused(folder.path(), "is no file");
  expect_refused(folder.path() / "nowhere" / "secrets", "neither");
}

TEST_F(AccessControlTest, WithoutTokenOrWithAnotherNobodyMayLook) {
  EXPECT_EQ(page("/"), AccessDecision::kNoToken);
  EXPECT_EQ(page("/?token="), AccessDecision::kNoToken);
  EXPECT_EQ(page("/?token=" + kSecret.substr(1) + "0"), AccessDecision::kNoToken);
  EXPECT_EQ(page("/?token=" + kSecret + "0"), AccessDecision::kNoToken);
  EXPECT_EQ(page("/?nottoken=" + kSecret), AccessDecision::kNoToken);
  EXPECT_EQ(page("/", "127.0.0.1:8420", "", "twofold-8421=" + kCookie), AccessDecision::kNoToken);
  EXPECT_EQ(socket("http://127.0.0.1:8420", ""), AccessDecision::kNoToken) << "a token in a socket's address";
  EXPECT_EQ(page("/", "127.0.0.1:8420", "", "twofold-8420=" + kSecret), AccessDecision::kNoToken);
  EXPECT_EQ(page("/?token=" + kCookie), AccessDecision::kNoToken)
      << "who saw the cookie does not know the address";
}

TEST_F(AccessControlTest, NamesOfOthersAreRefused) {
  for (const char* host : {"", "evil.example", "evil.example:8420", "127.0.0.1.evil.example",
                           "localhost.evil.example:8420", "127.0.0.1:", "127.0.0.1:84200000", "127.0.0.1:84a",
                           "[::1", "robot.example", "robot.lab", "robot.local.evil.example", "127.0.0.1 "})
    EXPECT_EQ(page("/?token=" + kSecret, host), AccessDecision::kBadHost) << host;
  for (const char* host :
       {"localhost", "localhost:9000", "127.0.0.1:8420", "[::1]:8420", "192.168.1.7:8420", "robot:8420",
        "ROBOT:8420", "robot.local:8420", "Robot.Local", "robot.lab.example:8420"})
    EXPECT_EQ(page("/?token=" + kSecret, host), AccessDecision::kByToken) << host;
}

TEST_F(AccessControlTest, PagesOfOthersAreRefused) {
  for (const char* origin :
       {"", "null", "http://evil.example", "https://127.0.0.1:8420", "http://127.0.0.1:3000",
        "http://127.0.0.1:8420.evil.example", "http://localhost:8420"})
    EXPECT_EQ(socket(origin, cookie_), AccessDecision::kBadOrigin) << origin;
  EXPECT_EQ(page("/page.js", "127.0.0.1:8420", "http://evil.example", cookie_), AccessDecision::kBadOrigin);
}

TEST_F(AccessControlTest, NamesAreTheSameInUpperAndLowerCase) {
  EXPECT_EQ(socket("http://robot.local:8420", cookie_, "robot.local:8420"), AccessDecision::kByCookie);
  EXPECT_EQ(socket("http://robot.local:8420", cookie_, "Robot.local:8420"), AccessDecision::kByCookie);
}

TEST_F(AccessControlTest, AnswersGetAlone) {
  EXPECT_EQ(access_.decide({"POST", "/?token=" + kSecret, "127.0.0.1:8420", "", cookie_, false}),
            AccessDecision::kBadMethod);
}

TEST_F(AccessControlTest, CookieIsNoScriptsAndNoOtherSites) {
  EXPECT_EQ(access_.set_cookie(), cookie_ + "; Path=/; HttpOnly; SameSite=Strict");
}

TEST(RandomSecret, Has128Bits) {
  const std::string secret = random_secret();
  EXPECT_EQ(secret.size(), 32U);
  EXPECT_EQ(secret.find_first_not_of("0123456789abcdef"), std::string::npos);
  EXPECT_NE(secret, random_secret());
}

}  // namespace
}  // namespace twofold
