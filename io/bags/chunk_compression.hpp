#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace twofold {

/// Largest chunk that is unpacked [bytes]; sizes in files are not trusted before anything is allocated.
inline constexpr std::uint64_t kLargestChunk = std::uint64_t{512} << 20;

/// Unpacks a chunk into `unpacked`, which keeps its memory from chunk to chunk. `compression`: "zstd", "lz4"
/// (frames), "bz2". Throws MalformedBytes when it is another, `size` is beyond kLargestChunk, or the bytes
/// unpack to anything but `size` bytes.
void unpack_chunk(const std::string& compression, std::span<const std::uint8_t> packed, std::uint64_t size,
                  std::vector<std::uint8_t>& unpacked);

}  // namespace twofold
