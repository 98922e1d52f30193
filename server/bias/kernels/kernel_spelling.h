#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "server/base/result.h"
#include "server/bias/kernels/kernel.h"
#include "server/bias/kernels/linear_block.h"

namespace trammel {

/// Parses a kernel: `matern52 + periodic`, `se(sincos) * (linear + white)`. Words are those of
/// kernel_names(), each also with `(sincos)`; `*` binds before `+`. Refuses unknown words and names
/// the known ones. Refuses a text that is not such a sum, and more than 32 words or 1000 bytes.
[[nodiscard]] Result<KernelPtr> spelled_kernel(std::string_view spelling);

/// The parts of a bias.
struct SpelledBias {
  KernelPtr kernel;                    ///< of each coordinate by itself
  std::vector<LinearBlockPtr> blocks;  ///< whose weights the coordinates share
  bool flange = false;  ///< the kernel is of the flange's error, seen through the tool's lever
  /// True if predictions need features of a pose besides its joints.
  [[nodiscard]] bool needs_features() const { return flange || !blocks.empty(); }
  [[nodiscard]] bool has(std::string_view block) const;
};

/// A kernel as above, to which the blocks `joint_map` and `parameters` may be added: `matern52 +
/// joint_map`; or the word `flange` (flange/README.md): `se + flange`. Refuses the same as
/// spelled_kernel(). Refuses a block that is in a product or in parentheses, is repeated, or has no
/// kernel beside it. Refuses `flange` beside a block.
[[nodiscard]] Result<SpelledBias> spelled_bias(std::string_view spelling);

/// The spelling without the word `flange`: a rotation is the same at every lever.
[[nodiscard]] std::string without_flange(std::string_view spelling);

/// Checks that a bias may be written so: as above, `none`, or `auto` (choose_bias.h).
[[nodiscard]] Status check_bias_spelling(std::string_view spelling);

}  // namespace trammel
