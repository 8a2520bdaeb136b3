// Files that MCAP's own library wrote: scripts/test_bags.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "io/bags/bag_reader.hpp"
#include "io/bags/ros_messages.hpp"

namespace twofold {
namespace {

namespace fs = std::filesystem;

std::uint32_t topic_named(const BagReader& reader, const std::string& name) {
  for (const BagTopic& topic : reader.topics()) {
    if (topic.name != name) continue;
    EXPECT_EQ(topic.type, "sensor_msgs/Image");
    EXPECT_EQ(topic.encoding, MessageEncoding::kCdr);
    return topic.id;
  }
  ADD_FAILURE() << "no topic " << name;
  return 0;
}

TEST(McapLibrary, WritesWhatIsReadHere) {
  const char* const folder = std::getenv("TWOFOLD_MCAP_FILES");
  if (folder == nullptr) GTEST_SKIP() << "TWOFOLD_MCAP_FILES is not set: scripts/test_bags writes the files";
  int files = 0;
  for (const auto& entry : fs::directory_iterator(folder)) {
    SCOPED_TRACE(entry.path().filename().string());
    const auto reader = open_mcap(entry.path());
    EXPECT_EQ(reader->topics().size(), 2U);
    reader->select({topic_named(*reader, "/camera/image")});
    BagMessage message;
    for (int i = 0; i < 20; ++i) {
      ASSERT_TRUE(reader->next(message)) << i;
      EXPECT_EQ(message.t_ns, i * 100'000'000LL);
      const ImageMessage image = parse_image(message.data, MessageEncoding::kCdr);
      EXPECT_EQ(image.t_ns, message.t_ns);
      EXPECT_EQ(image.encoding, "mono8");
      ASSERT_EQ(image.pixels.size(), 16U * 8U);
      EXPECT_TRUE(
          std::all_of(image.pixels.begin(), image.pixels.end(), [i](auto pixel) { return pixel == i; }));
    }
    EXPECT_FALSE(reader->next(message));
    EXPECT_EQ(reader->fault(), "");
    ++files;
  }
  EXPECT_EQ(files, 13);
}

}  // namespace
}  // namespace twofold
