#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <set>

#include "io/bags/bag_cameras.hpp"
#include "io/bags/bag_reader.hpp"

namespace twofold {

/// The ids that messages of a topic have.
[[nodiscard]] std::set<std::uint32_t> ids_of(const MergedTopic& topic);
/// Those of all cameras' images.
[[nodiscard]] std::set<std::uint32_t> image_ids(const BagCameras& cameras);

/// What the first images of a bag say of all. A bag is larger than memory, and some have no index: nobody
/// looks at the last ones.
struct BagSurvey {
  cv::Mat first;                 ///< the first left image that can be decoded
  int grey_bits = 16;            ///< of grey images of 16 bits
  std::int64_t interval_ns = 0;  ///< between images of the faster camera, median; 0: not known
};

/// Throws IoError when there is no left image, or none among the first ones can be decoded.
[[nodiscard]] BagSurvey survey_bag(BagReader& reader, const BagCameras& cameras,
                                   const std::filesystem::path& file);

}  // namespace twofold
