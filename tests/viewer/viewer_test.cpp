#include "twofold/viewer.hpp"

#include <gtest/gtest.h>

#include <thread>

#include "tests/viewer/local_client.hpp"
#include "tests/viewer/small_map.hpp"

namespace twofold {
namespace {

using testing::LocalClient;
using testing::tracked_pose;

const CameraRig kRig{
    .width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 320, .cy = 240, .baseline = 0.1};

class ViewerTest : public ::testing::Test {
 protected:
  LocalClient watch(const Viewer& viewer) {
    const std::string address = viewer.address();
    const int port = std::stoi(address.substr(address.rfind(':') + 1));
    LocalClient client(port);
    client.send(testing::upgrade_request(port, address.substr(address.find('=') + 1)));
    return client;
  }
};

TEST_F(ViewerTest, TellsWhatItIsToldAndTheEnd) {
  Viewer viewer(kRig, {}, {.title = "a robot", .port = 0});
  LocalClient client = watch(viewer);
  (void)client.receive(300);
  for (int n = 0; n < 20; ++n) client.send(testing::text_frame("images on"));
  viewer.tell(tracked_pose(0, 0));
  MapEvent joined;
  joined.kind = MapEventKind::kPartsJoined;
  viewer.tell(joined);
  viewer.finish();
  const std::string told = client.receive(std::string::npos, std::chrono::milliseconds(500));
  EXPECT_NE(told.find("parts joined"), std::string::npos);
  EXPECT_NE(told.find("the run is over"), std::string::npos);
}

TEST_F(ViewerTest, NobodyWaitsForIt) {
  Viewer viewer(kRig, {}, {.port = 0});
  const LocalClient reads_nothing = watch(viewer);
  const auto begin = std::chrono::steady_clock::now();
  for (std::int64_t n = 0; n < 200'000; ++n) viewer.tell(tracked_pose(n, 0));  // far more than the ring holds
  const auto each = (std::chrono::steady_clock::now() - begin) / 200'000;
  EXPECT_LT(each, std::chrono::microseconds(50));
}

TEST_F(ViewerTest, AsksForImagesWhileSomebodyWantsThem) {
  Viewer viewer(kRig, {}, {.port = 0});
  EXPECT_FALSE(viewer.wants_image());
  LocalClient client = watch(viewer);
  (void)client.receive(300);
  client.send(testing::text_frame("images on"));
  for (int n = 0; n < 100 && !viewer.wants_image(); ++n)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  ASSERT_TRUE(viewer.wants_image());
  const auto pixels = std::make_shared<std::vector<std::uint8_t>>(64 * 48, 128);
  viewer.show(7, {pixels->data(), 64, 48, 64}, pixels);
  EXPECT_FALSE(viewer.wants_image()) << "one at a time";
  EXPECT_NE(client.receive(std::string::npos, std::chrono::milliseconds(800)).find("JFIF"),
            std::string::npos);
  EXPECT_EQ(pixels.use_count(), 1) << "let go of when it was encoded";
}

TEST_F(ViewerTest, SaysThatAPortIsTaken) {
  const Viewer first(kRig, {}, {.port = 0});
  const std::string address = first.address();
  const int port = std::stoi(address.substr(address.rfind(':') + 1));
  EXPECT_THROW(Viewer(kRig, {}, {.port = port}), std::runtime_error);
}

}  // namespace
}  // namespace twofold
