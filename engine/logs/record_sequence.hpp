#pragma once

#include <cstddef>
#include <cstring>
#include <memory>
#include <span>
#include <type_traits>

#include "base/check.hpp"
#include "engine/logs/chunked_vector.hpp"
#include "engine/logs/index_iterator.hpp"
#include "engine/logs/log_file.hpp"
#include "engine/logs/mapped_file.hpp"

namespace twofold {

/// Records that arise for as long as a run goes on, and are read when it is over. In memory; or, once there
/// is a file, in that, and no memory grows with them; or the newest in memory only.
template <class T>
class RecordSequence {
  static_assert(std::is_trivially_copyable_v<T>, "records go to disk and back as bytes");

 public:
  using value_type = T;

  /// From here on records go to `file`, which holds nothing else. They cannot be read before read_back.
  void keep_in(std::shared_ptr<LogFile> file) { file_ = std::move(file); }
  /// Of those in memory at least so many of the newest are kept; older ones are forgotten.
  void keep_newest(std::size_t most) { most_ = most; }

  void push_back(const T& record) {
    if (file_) {
      const std::span bytes(reinterpret_cast<const std::uint8_t*>(&record), sizeof(T));
      if constexpr (requires { record.t_ns; }) {
        file_->append(bytes, record.t_ns);
      } else {
        file_->append(bytes);
      }
      return;
    }
    memory_.push_back(record);
    while (memory_.size() >= most_ && memory_.size() - most_ >= memory_.chunks().front().size()) {
      forgotten_ += memory_.chunks().front().size();
      memory_.forget_first_chunk();
    }
  }
  /// When the file is written: reads and changes are those of its pages from now on.
  void read_back() {
    if (!file_) return;
    mapped_ = MappedFile(*file_);
    file_.reset();
  }

  [[nodiscard]] std::size_t size() const {
    TWOFOLD_CHECK(!file_, "records on disk are read when the run is over");
    return mapped_.bytes().empty() ? memory_.size() : mapped_.bytes().size() / sizeof(T);
  }
  [[nodiscard]] bool empty() const { return size() == 0; }
  [[nodiscard]] const T& operator[](std::size_t i) const {
    return mapped_.bytes().empty() ? memory_[i] : mapped()[i];
  }
  [[nodiscard]] T& operator[](std::size_t i) { return mapped_.bytes().empty() ? memory_[i] : mapped()[i]; }
  [[nodiscard]] const T& front() const { return (*this)[0]; }
  [[nodiscard]] const T& back() const { return (*this)[size() - 1]; }
  /// Records older than the first one here.
  [[nodiscard]] std::size_t forgotten() const { return forgotten_; }

  using const_iterator = IndexIterator<RecordSequence, T>;
  [[nodiscard]] const_iterator begin() const { return {*this, 0}; }
  [[nodiscard]] const_iterator end() const { return {*this, size()}; }

 private:
  // The bytes of trivially copyable objects, from a page's beginning on.
  [[nodiscard]] T* mapped() const { return reinterpret_cast<T*>(mapped_.bytes().data()); }

  ChunkedVector<T> memory_;
  std::shared_ptr<LogFile> file_;
  MappedFile mapped_;
  std::size_t most_ = static_cast<std::size_t>(-1);
  std::size_t forgotten_ = 0;
};

}  // namespace twofold
