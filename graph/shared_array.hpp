#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <utility>

#include "base/atomics.hpp"

namespace twofold {

/// Handle of an array whose copies share it; the last one destroys it. Its length and type are known to
/// whoever made it: two words beside the values, where std::shared_ptr<T[]> has seven, and the arrays are
/// short.
///
/// Threads: a handle is used by one thread at a time, two handles of one array by two threads. Who finds that
/// no other handle is left (shared) may write to the array, and who drops the last one destroys it, after all
/// that others did through theirs.
template <class Atomics>
class BasicSharedArray {
 public:
  BasicSharedArray() = default;
  // Relaxed: whoever copies a handle already sees the array.
  BasicSharedArray(const BasicSharedArray& other) : header_(other.header_) {
    if (header_) header_->uses.fetch_add(1, std::memory_order_relaxed);
  }
  BasicSharedArray(BasicSharedArray&& other) noexcept : header_(std::exchange(other.header_, nullptr)) {}
  BasicSharedArray& operator=(BasicSharedArray other) noexcept {
    std::swap(header_, other.header_);
    return *this;
  }
  // Release: what was read or written through this handle comes before the array's end; acquire: the end
  // comes after what was done through all the others.
  ~BasicSharedArray() {
    if (header_ && header_->uses.fetch_sub(1, std::memory_order_acq_rel) == 1) header_->destroy(header_);
  }

  /// count > 0 values E().
  template <class E>
  [[nodiscard]] static BasicSharedArray make(std::size_t count) {
    BasicSharedArray array;
    void* block = ::operator new (begin<E>() + count * sizeof(E), std::align_val_t{alignment<E>()});
    array.header_ = ::new (block) Header{1, 0, &destroy<E>};
    for (auto& made = array.header_->count; made < count; ++made) ::new (array.template data<E>() + made) E();
    return array;
  }

  /// Its values; E as it was made with. Not for an empty handle.
  template <class E>
  [[nodiscard]] E* data() const {
    return reinterpret_cast<E*>(reinterpret_cast<std::byte*>(header_) + begin<E>());
  }

  /// Another handle has it too. Acquire: where there is none left, what others did through theirs is done,
  /// and the array can be written to.
  [[nodiscard]] bool shared() const { return header_ && header_->uses.load(std::memory_order_acquire) > 1; }

 private:
  struct Header {
    typename Atomics::template Atomic<std::uint32_t> uses;
    std::uint32_t count;
    void (*destroy)(Header*);
  };

  template <class E>
  static constexpr std::size_t alignment() {
    return std::max(alignof(Header), alignof(E));
  }
  template <class E>
  static constexpr std::size_t begin() {
    return std::max(sizeof(Header), alignof(E));
  }
  template <class E>
  static void destroy(Header* header) {
    auto* values = reinterpret_cast<E*>(reinterpret_cast<std::byte*>(header) + begin<E>());
    std::destroy_n(values, header->count);
    std::destroy_at(header);
    ::operator delete (header, std::align_val_t{alignment<E>()});
  }

  Header* header_ = nullptr;
};

using SharedArray = BasicSharedArray<StdAtomics>;

}  // namespace twofold
