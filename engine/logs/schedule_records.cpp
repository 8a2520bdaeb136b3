#include "engine/logs/schedule_records.hpp"

#include "base/check.hpp"

namespace twofold {

// Tracker record: flags (1 fate, 2 has messages, 8 keyframe withheld, effort level in the upper half; 4 was
// of format 2 and is free), frame and version as differences, then the number of messages if the flags
// announce it.
void encode_step(std::vector<std::uint8_t>& bytes, const TrackerStep& step, const TrackerStep& last) {
  TWOFOLD_CHECK(step.effort_level <= 15, "effort level");
  const unsigned flags = static_cast<unsigned>(step.fate) | (step.messages ? 2U : 0U) |
                         (step.keyframe_withheld ? 8U : 0U) | static_cast<unsigned>(step.effort_level) << 4;
  bytes.push_back(static_cast<std::uint8_t>(flags));
  put_varint(bytes, zigzag(static_cast<std::uint64_t>(step.frame), static_cast<std::uint64_t>(last.frame)));
  put_varint(bytes, zigzag(step.version, last.version));
  if (step.messages) put_varint(bytes, step.messages);
}
TrackerStep decode_step(ByteCursor& in, const TrackerStep& last) {
  TrackerStep step;
  const unsigned flags = in.byte();
  step.fate = static_cast<TrackerStep::Fate>(flags & 1U);
  step.effort_level = static_cast<std::uint8_t>(flags >> 4);
  step.keyframe_withheld = (flags & 8U) != 0;
  step.frame = static_cast<std::int64_t>(unzigzag(in.varint(), static_cast<std::uint64_t>(last.frame)));
  step.version = unzigzag(in.varint(), last.version);
  if (flags & 2U) step.messages = in.varint32();
  return step;
}

void encode_step(std::vector<std::uint8_t>& bytes, const MapperStep& step, const MapperStep& last) {
  put_varint(bytes, zigzag(step.version, last.version));
  put_varint(bytes, step.proposals);
  put_varint(bytes, step.loop_messages);
}
MapperStep decode_step(ByteCursor& in, const MapperStep& last) {
  MapperStep step;
  step.version = unzigzag(in.varint(), last.version);
  step.proposals = in.varint32();
  step.loop_messages = in.varint32();
  return step;
}

void encode_step(std::vector<std::uint8_t>& bytes, const LoopStep& step, const LoopStep& last) {
  put_varint(bytes, zigzag(step.version, last.version));
  put_varint(bytes,
             zigzag(static_cast<std::uint64_t>(step.keyframe), static_cast<std::uint64_t>(last.keyframe)));
  put_varint(bytes, step.requests);
  put_varint(bytes, step.refused);
}
LoopStep decode_step(ByteCursor& in, const LoopStep& last) {
  LoopStep step;
  step.version = unzigzag(in.varint(), last.version);
  step.keyframe = static_cast<std::int64_t>(unzigzag(in.varint(), static_cast<std::uint64_t>(last.keyframe)));
  step.requests = in.varint32();
  step.refused = in.varint32();
  return step;
}

void check_order(ByteCursor& in, const TrackerStep& step, const TrackerStep* last) {
  if (step.frame < 0 || (last != nullptr && step.frame <= last->frame)) in.fail("has frames out of order");
}
void check_order(ByteCursor&, const MapperStep&, const MapperStep*) {}
void check_order(ByteCursor& in, const LoopStep& step, const LoopStep*) {
  if (step.keyframe < -1) in.fail("has a negative keyframe number");
}

}  // namespace twofold
