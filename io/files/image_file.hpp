#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "camera/pinhole.hpp"

namespace twofold {

/// Largest image accepted from a file [pixels]; sizes in files are not trusted before anything is allocated.
inline constexpr std::int64_t kMaxImagePixels = std::int64_t{1} << 26;

/// An image file as CV_8UC1; colour becomes luminance, 16 bits become 8. Rows are those of the file, as the
/// sensor has them, whatever EXIF says of how to hold the picture: depth images and calibrations know nothing
/// of it.
///
/// Throws IoError when the file is missing, of no known kind, cut short, damaged (PNG: chunk check sums;
/// JPEG: end marker) or too large. The decoders alone would fill the missing part of a cut-off JPEG with grey
/// and go on.
///
/// `bits` of an image of 16 bits: the grey levels that it can hold are 2^bits; brighter ones become white.
[[nodiscard]] cv::Mat read_grey_image(const std::filesystem::path& file, int bits = 16);

/// Bits that the brightest pixel of a file of 16 bits takes, of which many cameras use 10 or 12; nothing for
/// files of 8. Throws as above.
[[nodiscard]] std::optional<int> bits_used(const std::filesystem::path& file);

/// An image file as CV_8UC3 (blue, green, red); empty when it has no colour. Throws as above.
[[nodiscard]] cv::Mat read_colour_image(const std::filesystem::path& file);

/// A depth image as CV_16UC1; throws likewise and when the file holds anything but one channel of 16 bits.
[[nodiscard]] cv::Mat read_depth_image(const std::filesystem::path& file);

/// Throws IoError naming the file when the image does not have the camera's size.
/// @param said_by  what said that size, as the clause that it ends: size_of_calibration or size_of_image
void expect_size(const std::filesystem::path& file, const cv::Mat& image, const PinholeCamera& camera,
                 const std::string& said_by);
[[nodiscard]] std::string size_of_calibration(const std::filesystem::path& file);
[[nodiscard]] std::string size_of_image(const std::filesystem::path& first);

/// Files in `folder` with an image's extension (png, jpg, jpeg, pgm, ppm, tif, tiff, bmp, webp), sorted by
/// name: numbers in names by value, and names that are decimal numbers altogether by theirs. Throws IoError
/// when the folder is missing or holds none.
[[nodiscard]] std::vector<std::filesystem::path> list_images(const std::filesystem::path& folder);

/// Puts images, whatever their folders, into that order.
void sort_images(std::vector<std::filesystem::path>& files);

}  // namespace twofold
