#include "viewer/texts.hpp"

#include <nlohmann/json.hpp>

#include "base/text_of_json.hpp"

namespace twofold {
namespace {

using Json = nlohmann::json;

Json json_of(const CameraRig& rig) {
  return {{"width", rig.width}, {"height", rig.height}, {"fx", rig.fx},
          {"fy", rig.fy},       {"cx", rig.cx},         {"cy", rig.cy}};
}

Json json_of(const MapSnapshot::Loop& loop) {
  return {{"from", loop.from},   {"to", loop.to},           {"joinsParts", loop.joins_parts},
          {"scale", loop.scale}, {"inliers", loop.inliers}, {"travelled", loop.travelled}};
}

Json json_of(const ViewEvent& event) {
  return {{"kind", event.kind},
          {"text", event.text},
          {"frame", event.frame},
          {"t", event.t},
          {"keyframe", event.keyframe},
          {"partBefore", event.part_before},
          {"part", event.part},
          {"moved", event.moved},
          {"turned", event.turned},
          {"before", event.before},
          {"after", event.after},
          {"loop", event.loop ? json_of(*event.loop) : Json()},
          {"scale", event.scale ? Json(*event.scale) : Json()}};
}

const char* word_of(ViewKind kind) {
  switch (kind) {
    case ViewKind::kLive:
      return "live";
    case ViewKind::kFinished:
      return "finished";
    case ViewKind::kMap:
      break;
  }
  return "map";
}

std::string text_of(const Json& json) {
  return text_of_json(json);
}

}  // namespace

std::string hello_text(const ViewTitle& title) {
  const Json rig = title.rig ? json_of(*title.rig) : Json();
  return text_of({{"hello",
                   {{"protocol", kViewProtocol},
                    {"title", title.title},
                    {"rig", rig},
                    {"stages", title.stages},
                    {"live", title.kind == ViewKind::kLive},
                    {"kind", word_of(title.kind)},
                    {"metres", title.metres},
                    {"hasDeviations", title.has_deviations},
                    {"hasFirstSeen", title.has_first_seen},
                    {"hasObservers", title.has_observers},
                    {"hasTimes", title.has_times},
                    {"hasQueues", title.kind == ViewKind::kLive},
                    {"efforts", title.efforts},
                    {"pacedBy", title.paced_by},
                    {"control", title.control},
                    {"keyframeImages", title.keyframe_images},
                    {"periodMs", title.period_ms}}}});
}

std::string state_text(const ViewScene& scene) {
  return text_of({{"state", {{"mappingPaused", scene.mapping_paused()}}}});
}

std::string reasons_text(const std::vector<std::string>& reasons) {
  return text_of({{"reasons", reasons}});
}

std::string truth_text(const ViewTruth& truth) {
  return text_of({{"truth", {{"part", truth.part}, {"scale", truth.scale}, {"path", truth.path}}}});
}

std::string events_text(const ViewScene& scene, std::uint64_t begin) {
  Json events = Json::array();
  for (std::uint64_t n = std::max(begin, scene.first_event()); n < scene.end_event(); ++n)
    events.push_back(json_of(scene.event(n)));
  return text_of({{"events", events}});
}

std::string ended_text(const std::string& message) {
  return text_of({{"status", {{"ended", true}, {"message", message}}}});
}

}  // namespace twofold
