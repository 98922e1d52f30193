#include "server/bias/kernel.h"

namespace trammel {

std::shared_ptr<const Kernel> make_kernel(std::string_view name) { return make_radial_kernel(name); }

std::string kernel_names() { return "se, matern32, matern52"; }

}  // namespace trammel
