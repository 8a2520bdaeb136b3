// Writes small recordings of ROS for the fuzzer to begin with: write_bag_corpus FOLDER
#include <filesystem>
#include <fstream>

#include "fixtures/bag_writer.hpp"

namespace {

using namespace twofold;
using namespace twofold::testing;

WrittenBag small_bag(MessageEncoding encoding) {
  WrittenBag bag;
  bag.topics = {{"/a/image", "sensor_msgs/Image"}, {"/a/camera_info", "sensor_msgs/CameraInfo"}};
  WrittenCameraInfo info;
  info.width = 4;
  info.height = 3;
  info.K = {4, 0, 1.5, 0, 4, 1, 0, 0, 1};
  info.D = {0.1, 0.2};
  WrittenCameraInfo rational = info;
  rational.model = "rational_polynomial";
  rational.D = {0.2, 0.05, 0.0005, -0.0003, 0.001, 0.5, 0.15, 0.01};
  bag.messages = {{0, 5, image_message(encoding, 5, cv::Mat(3, 4, CV_8UC1, cv::Scalar(7)), "mono8")},
                  {1, 5, camera_info_message(encoding, info)},
                  {1, 6, camera_info_message(encoding, rational)},
                  {0, 6, compressed_image_message(encoding, 6, "png", Bytes(9, 3))},
                  {0, 7, image_message(encoding, 7, cv::Mat(3, 4, CV_8UC3, cv::Scalar(7, 8, 9)), "rgb8")}};
  return bag;
}

void write(const std::filesystem::path& file, const Bytes& bytes) {
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  for (const char* compression : {"", "zstd", "lz4"}) {
    const std::string name = std::string("mcap_") + compression;
    for (const bool summary : {true, false}) {
      // Without checksums: they would stop nearly every mutation.
      write(folder / (name + (summary ? "_summary" : "")),
            mcap_file(small_bag(MessageEncoding::kCdr),
                      {MessageEncoding::kCdr, compression, 2, summary, false}));
    }
  }
  for (const char* compression : {"none", "bz2", "lz4"}) {
    for (const bool index : {true, false})
      write(folder / (std::string("rosbag_") + compression + (index ? "_index" : "")),
            rosbag_file(small_bag(MessageEncoding::kRos1), {compression, 2, index}));
  }
}
