#include "twofold/viewer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <future>
#include <limits>
#include <thread>

#include <fmt/format.h>

#include "fixtures/option_rules.hpp"
#include "graph/graph_writer.hpp"
#include "slam/map_snapshot.hpp"
#include "tests/viewer/local_client.hpp"
#include "tests/viewer/small_map.hpp"
#include "viewer/server.hpp"

namespace twofold {
namespace {

using testing::LocalClient;
using testing::tracked_pose;

const CameraRig kRig{
    .width = 640, .height = 480, .fx = 500, .fy = 500, .cx = 320, .cy = 240, .baseline = 0.1};

class ViewerTest : public ::testing::Test {
 protected:
  /// Within twenty seconds, looked at all the time.
  template <class Condition>
  static bool becomes(const Condition& condition) {
    for (int n = 0; n < 4000; ++n) {
      if (condition()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }
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
  const std::string told = client.receive_until("the run is over");
  EXPECT_NE(told.find("parts joined"), std::string::npos);
  EXPECT_NE(told.find("the run is over"), std::string::npos);
}

/// The last of the live frames in what a client got: those of one message.
ViewLiveFrame last_live_frame(const std::string& told) {
  ViewMessageHeader header{ViewMessageKind::kFrames, 1};
  for (header.number = 1; header.number < 10; ++header.number) {
    const std::string begin(reinterpret_cast<const char*>(&header), sizeof header);
    const std::size_t at = told.find(begin);
    ViewLiveFrame frame;
    const std::size_t last = at + begin.size() + (header.number - 1) * sizeof frame;
    if (at == std::string::npos || last + sizeof frame > told.size()) continue;
    std::memcpy(&frame, told.data() + last, sizeof frame);
    return frame;
  }
  ADD_FAILURE() << "no live frames";
  return {};
}

TEST_F(ViewerTest, TellsWhatWasDroppedAndLost) {
  Viewer viewer(kRig, {}, {.port = 0, .paced_by = "camera"});
  viewer.tell_lost(3);
  for (const std::int64_t frame : {7, 8, 11, 12, 14}) viewer.tell(tracked_pose(frame, 0));  // told from 7 on
  LocalClient client = watch(viewer);
  const std::string reason = "dropped: a newer frame was there";
  const std::string told =
      client.receive_until(reason) + client.receive(4000, std::chrono::milliseconds(500));
  EXPECT_NE(told.find(reason), std::string::npos);
  EXPECT_NE(told.find("\"pacedBy\":\"camera\""), std::string::npos);
  const ViewLiveFrame last = last_live_frame(told);
  EXPECT_EQ(last.frame, 14U);
  EXPECT_EQ(last.frames_dropped, 3U) << "9, 10 and 13";
  EXPECT_EQ(last.frames_lost, 3U);
}

TEST_F(ViewerTest, AsksForImagesWhileSomebodyWantsThem) {
  Viewer viewer(kRig, {}, {.port = 0});
  EXPECT_FALSE(viewer.wants_image());
  LocalClient client = watch(viewer);
  (void)client.receive(300);
  client.send(testing::text_frame("images on"));
  ASSERT_TRUE(becomes([&] { return viewer.wants_image(); }));
  const auto pixels = std::make_shared<std::vector<std::uint8_t>>(64 * 48, 128);
  viewer.show(7, {pixels->data(), 64, 48, 64}, pixels);
  EXPECT_NE(client.receive_until("JFIF").find("JFIF"), std::string::npos);
  EXPECT_TRUE(becomes([&] { return pixels.use_count() == 1; })) << "let go of when it was encoded";
}

/// What a page gets of an image that is overwritten as soon as `show` has returned.
TEST_F(ViewerTest, CopiesPixelsThatNobodyOwns) {
  const auto told = [this](bool owned) {
    Viewer viewer(kRig, {}, {.port = 0});
    LocalClient client = watch(viewer);
    (void)client.receive(300);
    client.send(testing::text_frame("images on"));
    EXPECT_TRUE(becomes([&] { return viewer.wants_image(); }));
    const auto pixels = std::make_shared<std::vector<std::uint8_t>>(64 * 48, 200);
    viewer.show(7, {pixels->data(), 64, 48, 64}, owned ? pixels : nullptr);
    if (!owned) std::fill(pixels->begin(), pixels->end(), std::uint8_t{10});
    const std::string text = client.receive_until("\xff\xd9");
    const std::size_t begin = text.find("\xff\xd8"), end = text.find("\xff\xd9");
    EXPECT_TRUE(begin < end && end != std::string::npos);
    return text.substr(begin, end - begin);
  };
  EXPECT_EQ(told(false), told(true));
}

/// However slow the machine: the bound grows with the time that has passed.
TEST_F(ViewerTest, AsksForFiveImagesASecond) {
  Viewer viewer(kRig, {}, {.port = 0});
  LocalClient client = watch(viewer);
  (void)client.receive(300);
  client.send(testing::text_frame("images on"));
  ASSERT_TRUE(becomes([&] { return viewer.wants_image(); }));
  const auto pixels = std::make_shared<std::vector<std::uint8_t>>(64 * 48, 128);
  const auto begin = std::chrono::steady_clock::now();
  int shown = 0;
  EXPECT_TRUE(becomes([&] {
    for (; viewer.wants_image(); ++shown) viewer.show(shown, {pixels->data(), 64, 48, 64}, pixels);
    return shown >= 4;
  }));
  const auto took = std::chrono::steady_clock::now() - begin;
  EXPECT_LE(shown, 2 + took / std::chrono::milliseconds(200));
}

/// A map of three keyframes, a second apart: keyframes 0, 1 and 3; number 2 was culled.
MapSnapshot map_of_three() {
  GraphWriter writer;
  for (const std::uint32_t k : {0U, 1U, 3U}) {
    if (k == 3) writer.add_forgotten_keyframes(1);
    twofold::Keyframe keyframe;
    keyframe.id = KeyframeId{k};
    keyframe.t_ns = (k + 1) * 1'000'000'000LL;
    writer.add_keyframe(std::move(keyframe));
  }
  auto version = std::make_shared<MapVersion>();
  version->graph = writer.publish();
  return MapSnapshot(std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{{}, version}));
}

TEST_F(ViewerTest, TellsTheLoopsOfTheMap) {
  const auto map = [] {
    auto version = std::make_shared<MapVersion>();
    ClosedLoop loop;
    loop.constraint.scale = 1.0625;
    loop.t_ns = 3'000'000'000;
    version->loops.push_back(loop);
    return MapSnapshot(std::make_shared<const MapSnapshot::Impl>(MapSnapshot::Impl{{}, version}));
  };
  Viewer viewer(kRig, map, {.port = 0});
  LocalClient client = watch(viewer);
  viewer.tell(tracked_pose(0, 0));
  EXPECT_NE(client.receive_until("\"scale\":1.0625").find("\"kind\":\"loop\""), std::string::npos);
}

TEST_F(ViewerTest, ShowsTheImageOfAKeyframe) {
  std::vector<std::int64_t> asked;
  const auto recorded = [&asked](std::int64_t t_ns) {
    asked.push_back(t_ns);
    const auto pixels = std::make_shared<std::vector<std::uint8_t>>(64 * 48, 128);
    return ViewedImage{{pixels->data(), 64, 48, 64}, pixels};
  };
  Viewer viewer(kRig, map_of_three, {.port = 0, .recorded_image = recorded});
  LocalClient client = watch(viewer);
  EXPECT_NE(client.receive_until("\"keyframeImages\":true").find("keyframeImages"), std::string::npos);
  client.send(testing::text_frame("keyframe 2"));  // there is none any more
  const std::string answer("\x05\0\0\0\x02\0\0\0", 8);
  EXPECT_NE(client.receive_until(answer).find(answer), std::string::npos) << "and that is said";
  EXPECT_TRUE(asked.empty()) << "nobody is asked for images of keyframes there are not";
  client.send(testing::text_frame("ack") + testing::text_frame("keyframe 3") +
              testing::text_frame("keyframe 1"));  // the last wish counts
  EXPECT_NE(client.receive_until("JFIF").find("JFIF"), std::string::npos);
  viewer.finish();
  EXPECT_EQ(asked, std::vector<std::int64_t>{2'000'000'000})
      << "of keyframes that there are, at their own times";
}

TEST_F(ViewerTest, AMapThatThrowsIsToldAndTheRestGoesOn) {
  std::atomic<int> asked{0};  // relaxed throughout: one number
  const auto map = [&asked]() -> MapSnapshot {
    asked.fetch_add(1, std::memory_order_relaxed);
    throw std::runtime_error("no map today");
  };
  Viewer viewer(kRig, map, {.port = 0});
  LocalClient client = watch(viewer);
  const std::string failure = client.receive_until("the map cannot be shown: no map today");
  EXPECT_NE(failure.find("\"kind\":\"viewer\""), std::string::npos);
  EXPECT_NE(failure.find("the map cannot be shown: no map today"), std::string::npos) << "and why";
  EXPECT_TRUE(becomes([&] { return asked.load(std::memory_order_relaxed) > 1; })) << "it is asked again";
  viewer.tell(tracked_pose(0, 0));
  viewer.finish();
  const std::string told = client.receive_until("the run is over");
  EXPECT_NE(told.find("the run is over"), std::string::npos) << "its thread is still there";
  EXPECT_EQ(told.find("no map today"), std::string::npos) << "told once";
}

TEST_F(ViewerTest, WhoTellsItSomethingDoesNotWaitForItsThread) {
  std::promise<void> map_is_there;
  std::atomic<bool> waits_for_map{false};  // relaxed throughout: one flag
  const auto map = [&waits_for_map, there = map_is_there.get_future().share()] {
    waits_for_map.store(true, std::memory_order_relaxed);
    there.wait();
    return map_of_three();
  };
  Viewer viewer(kRig, map, {.port = 0});
  EXPECT_TRUE(becomes([&] { return waits_for_map.load(std::memory_order_relaxed); }));
  const auto telling = std::async(std::launch::async, [&viewer] {
    for (std::int64_t n = 0; n < 200'000; ++n)
      viewer.tell(tracked_pose(n, 0));  // far more than its ring holds
  });
  EXPECT_EQ(telling.wait_for(std::chrono::seconds(30)), std::future_status::ready);
  map_is_there.set_value();
}

TEST_F(ViewerTest, AnImageThatNobodyWantsAnyMoreIsLetGoOf) {
  Viewer viewer(kRig, {}, {.port = 0});
  const auto pixels = std::make_shared<std::vector<std::uint8_t>>(64 * 48, 128);
  viewer.show(7, {pixels->data(), 64, 48, 64}, pixels);
  EXPECT_TRUE(becomes([&] { return pixels.use_count() == 1; }));
}

TEST_F(ViewerTest, FinishesOnceAndNotFromItsOwnCallbacks) {
  std::atomic<Viewer*> own{nullptr};  // relaxed: set before anybody can watch
  Viewer viewer(kRig, {}, {.port = 0, .on_command = [&own](ViewCommand) -> std::string {
                             own.load(std::memory_order_relaxed)->finish();
                             return "finished";
                           }});
  own.store(&viewer, std::memory_order_relaxed);
  LocalClient client = watch(viewer);
  (void)client.receive(300);
  client.send(testing::text_frame("stop"));
  const std::string refusal = client.receive_until("not finished by what it calls");
  EXPECT_NE(refusal.find("command failed"), std::string::npos);
  EXPECT_NE(refusal.find("not finished by what it calls"), std::string::npos);
  const std::jthread other([&viewer] { viewer.finish(); });
  viewer.finish();
  viewer.finish();
}

TEST_F(ViewerTest, PausingIsAStateThatLateViewersGet) {
  Viewer viewer(kRig, {}, {.port = 0, .on_command = [](ViewCommand) { return std::string("done"); }});
  LocalClient client = watch(viewer);
  (void)client.receive_until("\"mappingPaused\":false");
  client.send(testing::text_frame("ack") + testing::text_frame("pause mapping") +
              testing::text_frame("save map"));
  const std::string told = client.receive_until("map saved");
  EXPECT_NE(told.find("mapping paused"), std::string::npos) << "none of two commands is lost";
  LocalClient late = watch(viewer);
  EXPECT_NE(late.receive_until("\"mappingPaused\":true").find("\"mappingPaused\":true"), std::string::npos);
}

TEST_F(ViewerTest, RefusesPortsThatThereAreNotAndNames) {
  const auto refusal = [](const ViewerOptions& options) {
    try {
      const Viewer viewer(kRig, {}, options);
    } catch (const std::exception& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(refusal({.port = 70000}), "options.port must be in [0, 65535], is 70000");
  EXPECT_NE(refusal({.bind = "localhost", .port = 0}).find("such as 127.0.0.1"), std::string::npos);
}

TEST(ViewerOptionsTest, SayWhyTheyAreInvalid) {
  testing::expect_rules<ViewerOptions>(
      {{"bind", [](auto& o) { o.bind.clear(); }},
       {"port", [](auto& o) { o.port = -1; }},
       {"port", [](auto& o) { o.port = 65536; }},
       {"stages", [](auto& o) { o.stages.resize(9); }},
       {"frame_period", [](auto& o) { o.frame_period = -0.1; }},
       {"frame_period", [](auto& o) { o.frame_period = std::numeric_limits<double>::infinity(); }},
       {"paced_by", [](auto& o) { o.paced_by = "moon"; }},
       {"truth_t_ns", [](auto& o) {
          o.truth_t_ns = {2, 1};
        }}});
  testing::expect_rules<ViewServerOptions>({{"bind", [](auto& o) { o.bind.clear(); }},
                                            {"port", [](auto& o) { o.port = 65536; }},
                                            {"request_time", [](auto& o) { o.request_time = {}; }}});
}

TEST_F(ViewerTest, LoopbackAddressesAreNotTheNetwork) {
  const Viewer other(kRig, {}, {.bind = "127.0.0.2", .port = 0});
  EXPECT_FALSE(other.is_open_to_network());
  EXPECT_EQ(other.addresses(), std::vector<std::string>{other.address()});
  const Viewer everywhere(kRig, {}, {.bind = "0.0.0.0", .port = 0});
  EXPECT_TRUE(everywhere.is_open_to_network());
  EXPECT_TRUE(everywhere.addresses().back().starts_with("http://127.0.0.1:")) << "for who sits there";
  for (const std::string& address : everywhere.addresses()) {
    EXPECT_EQ(address.find("0.0.0.0"), std::string::npos) << "nobody can open that";
    EXPECT_NE(address.find(fmt::format(":{}/?token=", everywhere.port())), std::string::npos);
  }
}

TEST_F(ViewerTest, SaysThatAPortIsTaken) {
  const Viewer first(kRig, {}, {.port = 0});
  const std::string address = first.address();
  const int port = std::stoi(address.substr(address.rfind(':') + 1));
  EXPECT_THROW(Viewer(kRig, {}, {.port = port}), std::runtime_error);
}

}  // namespace
}  // namespace twofold
