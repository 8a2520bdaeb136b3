#include "io/bags/bag_cameras.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include <fmt/format.h>

#include "base/bytes.hpp"
#include "camera/camera_info.hpp"

namespace twofold {
namespace {

std::vector<MergedTopic> merge_topics(const std::vector<BagTopic>& topics) {
  std::vector<MergedTopic> merged;
  for (const BagTopic& topic : topics) {
    auto same = std::find_if(merged.begin(), merged.end(), [&](const MergedTopic& other) {
      return other.name == topic.name && other.type == topic.type;
    });
    if (same == merged.end()) same = merged.insert(merged.end(), {topic.name, topic.type, {}});
    same->encodings[topic.id] = topic.encoding;
  }
  return merged;
}

bool is_image(const MergedTopic& topic) {
  return topic.type == "sensor_msgs/Image" || topic.type == "sensor_msgs/CompressedImage";
}

bool contains(const std::string& text, std::string_view part) {
  return text.find(part) != std::string::npos;
}

/// Whether one of its words says so, as in /cam/image_rect_color; /direct/image_raw has none.
bool names_rectified(std::string_view topic) {
  while (!topic.empty()) {
    const std::size_t end = std::min(topic.find_first_of("/_"), topic.size());
    const std::string_view word = topic.substr(0, end);
    if (word == "rect" || word == "rectified") return true;
    topic.remove_prefix(std::min(end + 1, topic.size()));
  }
  return false;
}

bool is_depth(const MergedTopic& topic) {
  return contains(topic.name, "depth");
}

/// Smaller is taken first.
int rank(const MergedTopic& topic) {
  const bool compressed = topic.type == "sensor_msgs/CompressedImage";
  return (compressed ? 2 : 0) + (names_rectified(topic.name) ? 0 : 1);
}

std::string list(const std::vector<MergedTopic>& topics) {
  std::string names;
  for (const MergedTopic& topic : topics) {
    if (is_image(topic)) names += (names.empty() ? "" : ", ") + topic.name;
  }
  return names.empty() ? "none" : names;
}

const MergedTopic& named(const std::vector<MergedTopic>& topics, const std::string& name) {
  for (const MergedTopic& topic : topics) {
    if (topic.name == name && is_image(topic)) return topic;
  }
  throw MalformedBytes("no image topic '" + name + "'; there are: " + list(topics));
}

/// ROS puts a camera's info beside its images: /cam/image_raw, /cam/image_raw/compressed, /cam/camera_info.
BagCamera camera_of(const std::vector<MergedTopic>& topics, const MergedTopic& images) {
  BagCamera camera{images, {}};
  for (std::string folder = images.name; !camera.info && !folder.empty();) {
    const auto slash = folder.rfind('/');
    folder.resize(slash == std::string::npos ? 0 : slash);
    for (const MergedTopic& topic : topics) {
      if (topic.type == "sensor_msgs/CameraInfo" && topic.name == folder + "/camera_info")
        camera.info = topic;
    }
    if (images.name.size() - folder.size() > 40) break;
  }
  return camera;
}

/// Names of the right camera that the left one's suggests.
std::vector<std::string> partners(const std::string& left) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 6> kPairs{{{"left", "right"},
                                                                                 {"cam0", "cam1"},
                                                                                 {"camera0", "camera1"},
                                                                                 {"infra1", "infra2"},
                                                                                 {"image_0", "image_1"},
                                                                                 {"camera_0", "camera_1"}}};
  std::vector<std::string> names;
  for (const auto& [of_left, of_right] : kPairs) {
    if (!contains(left, of_left)) continue;
    std::string name = left;
    for (auto at = name.find(of_left); at != std::string::npos; at = name.find(of_left, at + of_right.size()))
      name.replace(at, of_left.size(), of_right);
    names.push_back(name);
  }
  return names;
}

struct Choice {
  std::vector<MergedTopic> colour, depth;  // best first
};

Choice sorted_images(const std::vector<MergedTopic>& topics) {
  Choice choice;
  for (const MergedTopic& topic : topics) {
    if (is_image(topic)) (is_depth(topic) ? choice.depth : choice.colour).push_back(topic);
  }
  for (auto* list : {&choice.colour, &choice.depth}) {
    std::stable_sort(list->begin(), list->end(),
                     [](const MergedTopic& a, const MergedTopic& b) { return rank(a) < rank(b); });
  }
  return choice;
}

/// The same images packed in another way, or those that ROS makes of them: /cam/image_raw, /cam/image_rect.
bool same_camera(const MergedTopic& a, const MergedTopic& b) {
  const auto plain = [](std::string name) {
    if (name.ends_with("/compressed")) name.resize(name.size() - std::string_view("/compressed").size());
    return name;
  };
  const std::string of_a = plain(a.name), of_b = plain(b.name);
  const auto folder = of_a.rfind("/image");
  return of_a == of_b || (folder != std::string::npos && of_a.find('/', folder + 1) == std::string::npos &&
                          of_b.rfind("/image") == folder && of_a.substr(0, folder) == of_b.substr(0, folder));
}

std::optional<std::pair<MergedTopic, MergedTopic>> find_pair(const std::vector<MergedTopic>& colour) {
  for (const MergedTopic& left : colour) {
    for (const std::string& name : partners(left.name)) {
      const auto right = std::find_if(colour.begin(), colour.end(), [&](const MergedTopic& topic) {
        return topic.name == name && topic.type == left.type;
      });
      if (right != colour.end()) return std::pair(left, *right);
    }
  }
  return std::nullopt;
}

bool all_of_one_camera(const std::vector<MergedTopic>& topics) {
  return !topics.empty() && std::all_of(topics.begin(), topics.end(), [&](const MergedTopic& topic) {
    return same_camera(topic, topics.front());
  });
}

/// What the numbers of a CameraInfo came to, or the way out in words.
template <class T>
T usable(tl::expected<T, std::string> found) {
  if (!found) throw MalformedBytes("camera_info: " + found.error() + ": give --calib");
  return *std::move(found);
}

CameraModel model_of(const BagCamera& camera, const CameraInfoMessage& info) {
  constexpr std::uint32_t kLargestSide = 1U << 16;
  if (info.width > kLargestSide || info.height > kLargestSide)
    throw MalformedBytes("camera_info of '" + camera.images.name + "' has an impossible size");
  if (camera.rectified()) return {rectified_pinhole(info), {}};
  return usable(raw_camera(info));
}

/// By how much of its width at most an image's corner is elsewhere in the other camera's image.
double largest_shift(const PinholeCamera& camera, const PinholeCamera& other) {
  double largest = 0;
  for (const Vector2& corner : {Vector2(0, 0), Vector2(camera.width, camera.height)}) {
    const Vector2 seen = other.project(camera.unproject(corner));
    largest = std::max(largest, (seen - corner).cwiseAbs().maxCoeff());
  }
  return largest / camera.width;
}

}  // namespace

bool BagCamera::rectified() const {
  return names_rectified(images.name);
}

BagCameras choose_cameras(const std::vector<BagTopic>& all, const WantedTopics& wanted) {
  const std::vector<MergedTopic> topics = merge_topics(all);
  BagCameras cameras;
  const auto camera = [&](const MergedTopic& topic) { return camera_of(topics, topic); };
  if (wanted.left) {
    cameras.left = camera(named(topics, *wanted.left));
    if (wanted.right) cameras.right = camera(named(topics, *wanted.right));
    if (wanted.depth) cameras.depth = camera(named(topics, *wanted.depth));
    return cameras;
  }
  if (wanted.right || wanted.depth) throw MalformedBytes("with right or depth goes left, the other images");
  const Choice choice = sorted_images(topics);
  if (const auto pair = find_pair(choice.colour)) {
    cameras.left = camera(pair->first);
    cameras.right = camera(pair->second);
    return cameras;
  }
  if (!all_of_one_camera(choice.colour) || (!choice.depth.empty() && !all_of_one_camera(choice.depth)))
    throw MalformedBytes("which images? Name topics by left, right, depth; there are: " + list(topics));
  cameras.left = camera(choice.colour.front());
  if (!choice.depth.empty()) cameras.depth = camera(choice.depth.front());
  return cameras;
}

Calibration calibration_of(const BagCameras& cameras, const CameraInfoMessage& left,
                           const std::optional<CameraInfoMessage>& right) {
  Calibration calibration;
  calibration.kind = cameras.kind();
  calibration.left = model_of(cameras.left, left);
  if (!(calibration.left.pinhole.fx > 0))
    throw MalformedBytes("camera_info of '" + cameras.left.images.name + "' is not calibrated: give --calib");
  if (!right) return calibration;
  calibration.right = model_of(*cameras.right, *right);
  const Vector3 t = usable(rectified_translation(left, *right));
  constexpr double kPure = 1e-4;  // of the baseline; beyond that rows of rectified images are not the same
  if (cameras.left.rectified() && cameras.right->rectified() && t.tail<2>().norm() <= kPure * t.norm()) {
    calibration.already_rectified = true;
    calibration.T_right_left = SE3(SO3(), Vector3(t.x(), 0, 0));
    return calibration;
  }
  // Of a pair of which one camera's images are rectified, that one's are turned already.
  const auto rotation = [](const BagCamera& camera, const CameraInfoMessage& info) {
    return SE3(camera.rectified() ? SO3() : usable(rectifying_rotation(info)), Vector3::Zero());
  };
  const SE3 T_rect_left = rotation(cameras.left, left), T_rect_right = rotation(*cameras.right, *right);
  calibration.T_right_left = T_rect_right.inverse() * SE3(SO3(), t) * T_rect_left;
  return calibration;
}

std::string depth_mismatch(const CameraInfoMessage& left, const CameraInfoMessage& depth) {
  constexpr double kTolerance = 0.01;  // drivers' defaults differ from what the same camera was calibrated to
  const PinholeCamera K_left = raw_pinhole(left), K = raw_pinhole(depth);
  const PinholeCamera P_left = rectified_pinhole(left), P = rectified_pinhole(depth);
  const auto says_nothing = [](const PinholeCamera& camera) {
    return !(camera.fx > 0 && camera.fy > 0 && camera.width > 0 && camera.height > 0);
  };
  if (says_nothing(K_left) || says_nothing(K)) return {};
  if (K.width != K_left.width || K.height != K_left.height)
    return fmt::format("{}x{} pixels against {}x{}", K.width, K.height, K_left.width, K_left.height);
  if (largest_shift(K_left, K) <= kTolerance) return {};
  if (!says_nothing(P_left) && !says_nothing(P) && largest_shift(P_left, P) <= kTolerance) return {};
  return fmt::format("fx {:.5g}, cx {:.5g} against {:.5g}, {:.5g}", K.fx, K.cx, K_left.fx, K_left.cx);
}

}  // namespace twofold
