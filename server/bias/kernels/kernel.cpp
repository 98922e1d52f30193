#include "server/bias/kernels/kernel.h"

#include <array>

namespace trammel {
namespace {

struct Leaf {
  std::string_view word;
  KernelPtr (*make)();
};

const std::array<Leaf, 7> kLeaves = {{{"se", [] { return make_radial_kernel("se"); }},
                                      {"matern32", [] { return make_radial_kernel("matern32"); }},
                                      {"matern52", [] { return make_radial_kernel("matern52"); }},
                                      {"periodic", make_periodic_kernel},
                                      {"rational_quadratic", make_rational_quadratic_kernel},
                                      {"linear", make_linear_kernel},
                                      {"white", make_white_kernel}}};

}  // namespace

KernelPtr make_leaf_kernel(std::string_view word) {
  for (const Leaf& leaf : kLeaves) {
    if (leaf.word == word) return leaf.make();
  }
  return nullptr;
}

std::string kernel_names() {
  std::string names;
  for (const Leaf& leaf : kLeaves) names.append(names.empty() ? "" : ", ").append(leaf.word);
  return names;
}

}  // namespace trammel
