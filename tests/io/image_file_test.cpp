#include "io/files/image_file.hpp"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "tests/io/scratch_folder.hpp"

namespace twofold {
namespace {

cv::Mat noise_image() {
  cv::Mat image(40, 60, CV_8UC1);
  std::mt19937 rng(3);
  for (int i = 0; i < 40 * 60; ++i) image.data[i] = static_cast<unsigned char>(rng() & 0xff);
  return image;
}

cv::Mat noise_in_colour() {
  cv::Mat image;
  const cv::Mat grey = noise_image();
  cv::merge(std::vector<cv::Mat>{grey, grey, grey}, image);
  return image;
}

TEST(ImageFile, ReadsGreyColourAndDepth) {
  const ScratchFolder folder;
  const cv::Mat image = noise_image();
  EXPECT_EQ(cv::norm(read_grey_image(folder.write_image("a.png", image)), image, cv::NORM_INF), 0);
  EXPECT_EQ(read_grey_image(folder.write_image("c.png", cv::Mat(4, 5, CV_8UC3, cv::Scalar(9, 9, 9)))).type(),
            CV_8UC1);
  const cv::Mat depth(4, 5, CV_16UC1, cv::Scalar(40000));
  EXPECT_EQ(cv::norm(read_depth_image(folder.write_image("d.png", depth)), depth, cv::NORM_INF), 0);
  EXPECT_IO_ERROR(read_depth_image(folder.path() / "a.png"), "this one has 1 of 8");
}

/// A telephone that was held upside down.
TEST(ImageFile, RowsAreThoseOfTheSensorWhateverExifSays) {
  const ScratchFolder folder;
  cv::Mat image(40, 60, CV_8UC3, cv::Scalar::all(20));
  image.rowRange(0, 20).setTo(cv::Scalar::all(220));
  std::string jpeg = bytes_of(folder.write_image("a.jpg", image));
  // One entry in big-endian TIFF: orientation (0x0112), short, 3.
  const std::string exif(
      "\xff\xe1\0\x22"
      "Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0",
      36);
  jpeg.insert(2, exif);
  const auto turned = folder.write("turned.jpg", jpeg);
  ASSERT_LT(cv::mean(cv::imread(turned.string(), cv::IMREAD_GRAYSCALE).rowRange(0, 15))[0], 40)
      << "the file says that it is upside down";
  EXPECT_GT(cv::mean(read_grey_image(turned).rowRange(0, 15))[0], 200);
  EXPECT_GT(cv::mean(read_colour_image(turned).rowRange(0, 15))[0], 200);
}

/// The order in which a folder with files of these names, written in another one, is listed.
std::vector<std::string> listed(std::vector<std::string> names) {
  const ScratchFolder folder;
  std::reverse(names.begin(), names.end());
  for (const std::string& name : names) folder.write(name, "");
  std::vector<std::string> list;
  for (const auto& file : list_images(folder.path())) list.push_back(file.filename().string());
  return list;
}

TEST(ImageFile, NumbersInNamesAreInOrderOfTheirValue) {
  const std::vector<std::string> names{"0.png",    "1.png",     "02.png",     "2.png",    "10.png",
                                       "a1b2.png", "a1b10.png", "a01b20.png", "a2b1.png", "b.png"};
  EXPECT_EQ(listed(names), names);
}

TEST(ImageFile, NamesThatAreDecimalNumbersToo) {
  const std::vector<std::string> times{"9.95.jpg",  "10.0.jpg", "10.05.jpg", "10.1.jpg",
                                       "10.15.jpg", "10.5.jpg", "11.jpg",    "100.25.png"};
  EXPECT_EQ(listed(times), times);
  const std::vector<std::string> chapters{"1.1.jpg", "1.2.jpg", "1.9.jpg", "1.10.jpg", "1.11.jpg"};
  EXPECT_EQ(listed(chapters), chapters) << "1.1 and 1.10 are two";
  const std::vector<std::string> versions{"1.2.3.jpg", "1.2.15.jpg", "1.10.jpg"};
  EXPECT_EQ(listed(versions), versions);
}

/// macOS lays "._NAME" beside each file on a stick or in an archive: no image, whatever its suffix.
TEST(ImageFile, OfAppleDoublesAreNone) {
  EXPECT_EQ(listed({"._1.png", "1.png", "_2.png"}), (std::vector<std::string>{"1.png", "_2.png"}));
}

TEST(ImageFile, SuffixesThatAreReadAreNamedWhereThereAreNone) {
  EXPECT_IO_ERROR(listed({"1.raw", "._1.png"}), "holds no images (files ending in .png, .jpg,");
}

TEST(ImageFile, ReadsPpmAndWebp) {
  for (const std::string name : {"a.ppm", "a.webp"}) {
    if (!cv::haveImageWriter(name)) continue;  // OpenCV may have been built without WebP
    const ScratchFolder folder;
    folder.write_image(name, noise_in_colour());
    const auto files = list_images(folder.path());
    ASSERT_EQ(files.size(), 1U);
    EXPECT_EQ(read_grey_image(files[0]).size(), noise_image().size());
  }
}

/// However short an image file is cut, it is refused: no decoder gets to fill in the rest.
TEST(ImageFile, RefusesEveryTruncation) {
  const ScratchFolder folder;
  for (const std::string name : {"a.png", "a.jpg", "a.pgm", "a.ppm"}) {
    const cv::Mat image = name == "a.ppm" ? noise_in_colour() : noise_image();
    const std::string whole = bytes_of(folder.write_image(name, image));
    ASSERT_FALSE(whole.empty());
    for (std::size_t length = 0; length < whole.size(); length += 7) {
      const auto cut = folder.write("cut_" + name, whole.substr(0, length));
      EXPECT_THROW((void)read_grey_image(cut), IoError) << name << " cut to " << length;
    }
  }
}

TEST(ImageFile, RefusesDamagedAndHugeImages) {
  const ScratchFolder folder;
  std::string png = bytes_of(folder.write_image("a.png", noise_image()));
  std::string damaged = png;
  damaged[damaged.size() / 2] = static_cast<char>(damaged[damaged.size() / 2] ^ 0x10);
  EXPECT_IO_ERROR(read_grey_image(folder.write("damaged.png", damaged)), "check sum");

  std::string jpeg = bytes_of(folder.write_image("a.jpg", noise_image()));
  const auto header = jpeg.find("\xff\xc0");
  ASSERT_NE(header, std::string::npos);
  jpeg.replace(header + 5, 4, "\xff\xff\xff\xff");
  EXPECT_IO_ERROR(read_grey_image(folder.write("huge.jpg", jpeg)), "impossible image size of 65535x65535");
  EXPECT_IO_ERROR(read_grey_image(folder.write("text.png", "no image")), "cannot be decoded");
  EXPECT_IO_ERROR(read_grey_image(folder.path() / "none.png"), "no such image file");
}

}  // namespace
}  // namespace twofold
