#include "python/arrays.hpp"

#include <atomic>

namespace twofold::python {
namespace {

/// Release when an owner is put there -> acquire when all are taken: what is on the list is seen whole.
std::atomic<ArrayOwner*> left_over{nullptr};

bool lies_row_by_row(const py::array& array, py::ssize_t pixel_bytes) {
  const bool colour = array.ndim() == 3;
  const bool pixels_together =
      array.strides(1) == pixel_bytes && array.strides(0) >= array.shape(1) * pixel_bytes;
  const bool colours_together = !colour || array.strides(2) == array.itemsize();
  return pixels_together && colours_together && array.attr("flags").attr("aligned").cast<bool>();
}

}  // namespace

std::shared_ptr<const void> ArrayOwner::share(std::unique_ptr<ArrayOwner> owner) {
  return {owner.release(), [](ArrayOwner* done) {
            done->next_ = left_over.load(std::memory_order_relaxed);
            while (!left_over.compare_exchange_weak(done->next_, done, std::memory_order_release,
                                                    std::memory_order_relaxed)) {
            }
          }};
}

void release_arrays() {
  ArrayOwner* owner = left_over.exchange(nullptr, std::memory_order_acquire);
  while (owner != nullptr) {
    const std::unique_ptr<ArrayOwner> done(owner);
    owner = done->next_;
  }
}

ImageView image_view(const py::object& object, const char* name, ImageFormat format, ArrayOwner& owner,
                     std::vector<std::string>& copied) {
  if (object.is_none()) return {};
  if (!py::isinstance<py::array>(object))
    throw py::type_error(std::string(name) + ": an image must be a numpy array");
  auto array = py::reinterpret_borrow<py::array>(object);
  const bool depth = format == ImageFormat::kDepth16;
  if (depth && py::isinstance<py::array_t<float>>(array)) format = ImageFormat::kDepth32F;
  const bool right_type =
      depth ? format == ImageFormat::kDepth32F || py::isinstance<py::array_t<std::uint16_t>>(array)
            : py::isinstance<py::array_t<std::uint8_t>>(array);
  const bool colour = array.ndim() == 3 && array.shape(2) == 3 && !depth;
  if (!right_type || (array.ndim() != 2 && !colour)) {
    throw py::value_error(std::string(name) + ": must be " +
                          (depth ? "uint16 or float32 of shape (height, width)"
                                 : "uint8 of shape (height, width) or (height, width, 3)"));
  }
  const py::ssize_t pixel_bytes = array.itemsize() * (colour ? 3 : 1);
  if (!lies_row_by_row(array, pixel_bytes)) {
    array = py::module_::import("numpy").attr("array")(array, py::arg("order") = "C");
    copied.emplace_back(name);
  }
  const ImageView view{array.data(), static_cast<int>(array.shape(1)), static_cast<int>(array.shape(0)),
                       array.strides(0), colour || depth ? format : ImageFormat::kGrey8};
  owner.keep(std::move(array));
  return view;
}

py::object array_of(const ImageView& image, py::handle owner) {
  if (image.data == nullptr) return py::none();
  if (image.format == ImageFormat::kDepth16)
    return view_of(static_cast<const std::uint16_t*>(image.data), {image.height, image.width}, owner,
                   {image.stride, 2});
  if (image.format == ImageFormat::kDepth32F)
    return view_of(static_cast<const float*>(image.data), {image.height, image.width}, owner,
                   {image.stride, 4});
  const auto* pixels = static_cast<const std::uint8_t*>(image.data);
  if (image.format == ImageFormat::kGrey8)
    return view_of(pixels, {image.height, image.width}, owner, {image.stride, 1});
  return view_of(pixels, {image.height, image.width, 3}, owner, {image.stride, 3, 1});
}

}  // namespace twofold::python
