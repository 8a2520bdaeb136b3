#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "twofold/types.hpp"

namespace twofold::python {

namespace py = pybind11;

/// A read-only array over memory that `owner` keeps.
template <class T>
[[nodiscard]] py::array view_of(const T* data, std::vector<py::ssize_t> shape, py::handle owner,
                                std::vector<py::ssize_t> strides = {}) {
  py::array array(py::dtype::of<T>(), std::move(shape), std::move(strides), data, owner);
  array.attr("flags").attr("writeable") = false;
  return array;
}

/// Arrays that images point into, until nobody needs the images any more.
///
/// The engine lets go of images on threads of its own, the tracker's among them, which must not wait for the
/// interpreter's lock: they put the arrays on a list, lock-free, and whoever holds the lock next gives them
/// back with `release_arrays`.
class ArrayOwner {
 public:
  void keep(py::object array) { arrays_.push_back(std::move(array)); }
  /// An owner for FrameView, by any thread.
  [[nodiscard]] static std::shared_ptr<const void> share(std::unique_ptr<ArrayOwner> owner);

 private:
  friend void release_arrays();
  std::vector<py::object> arrays_;
  ArrayOwner* next_ = nullptr;  // on the list
};
/// With the interpreter's lock held.
void release_arrays();

/// The pixels of an array of shape (height, width), or (height, width, 3) for colour: uint8, or uint16 for
/// depth. They stay where they are if a pixel's bytes and a row's pixels lie side by side; else they are
/// copied and `name` goes to `copied`. Throws py::value_error and py::type_error naming the image.
[[nodiscard]] ImageView image_view(const py::object& array, const char* name, ImageFormat format,
                                   ArrayOwner& owner, std::vector<std::string>& copied);

/// The array of an image, over its own pixels; None without an image.
[[nodiscard]] py::object array_of(const ImageView& image, py::handle owner);

}  // namespace twofold::python
