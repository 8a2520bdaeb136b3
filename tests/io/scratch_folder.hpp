#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "io/files/io_error.hpp"

namespace twofold {

/// A fresh folder that goes away with the test.
class ScratchFolder {
 public:
  ScratchFolder() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    // Outside of a test: set-up of a whole suite.
    const std::string name = test ? std::string(test->test_suite_name()) + "_" + test->name() : "suite";
    path_ = std::filesystem::temp_directory_path() / ("twofold_" + name + "_" + std::to_string(getpid()));
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  std::filesystem::path write(const std::string& name, const std::string& content) const {
    auto file = path_ / name;
    std::filesystem::create_directories(file.parent_path());
    std::ofstream(file, std::ios::binary) << content;
    return file;
  }
  std::filesystem::path write_image(const std::string& name, const cv::Mat& image) const {
    auto file = path_ / name;
    std::filesystem::create_directories(file.parent_path());
    cv::imwrite(file.string(), image);
    return file;
  }
  [[nodiscard]] std::string operator/(const std::string& name) const { return (path_ / name).string(); }

 private:
  std::filesystem::path path_;
};

inline std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// An image whose pixels tell it from others.
inline cv::Mat numbered_image(int width, int height, int number, int type = CV_8UC1) {
  cv::Mat image(height, width, type, cv::Scalar::all(number));
  for (int i = 0; i < std::min(width, height); ++i) image.row(i).col(i) = cv::Scalar::all(200);
  return image;
}

/// What the IoError of a call says; fails the test when there is none.
template <class F>
std::string io_error_of(F&& call) {
  try {
    call();
  } catch (const IoError& e) {
    EXPECT_EQ(std::string(e.what()).find('\n'), std::string::npos);
    return e.what();
  }
  ADD_FAILURE() << "no IoError";
  return "";
}

#define EXPECT_IO_ERROR(call, part)                                             \
  do {                                                                          \
    const std::string message = io_error_of([&] { (void)(call); });             \
    EXPECT_NE(message.find(part), std::string::npos) << "message: " << message; \
  } while (false)

}  // namespace twofold
