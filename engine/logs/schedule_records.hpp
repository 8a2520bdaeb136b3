#pragma once

#include <cstdint>
#include <vector>

#include "engine/logs/byte_cursor.hpp"
#include "engine/logs/schedule_log.hpp"

namespace twofold {

// One record of each thread's stream as bytes, relative to the record before.

void encode_step(std::vector<std::uint8_t>& bytes, const TrackerStep& step, const TrackerStep& last);
void encode_step(std::vector<std::uint8_t>& bytes, const MapperStep& step, const MapperStep& last);
void encode_step(std::vector<std::uint8_t>& bytes, const LoopStep& step, const LoopStep& last);

/// The bytes may be anything: the cursor fails when they are no record.
[[nodiscard]] TrackerStep decode_step(ByteCursor& in, const TrackerStep& last);
[[nodiscard]] MapperStep decode_step(ByteCursor& in, const MapperStep& last);
[[nodiscard]] LoopStep decode_step(ByteCursor& in, const LoopStep& last);

/// Makes the cursor fail when a record of good form cannot follow the one before (null: it is the first).
void check_order(ByteCursor& in, const TrackerStep& step, const TrackerStep* last);
void check_order(ByteCursor& in, const MapperStep& step, const MapperStep* last);
void check_order(ByteCursor& in, const LoopStep& step, const LoopStep* last);

}  // namespace twofold
