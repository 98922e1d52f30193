#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "contract.h"
#include "correct_target.h"
#include "diagnose.h"
#include "idl/repairs/cdr_walk.h"
#include "manage_models.h"
#include "predict_error.h"
#include "read_models.h"
#include "release_batches.h"
#include "state.h"
#include "training.h"

/// Checks what the generated code does not check when it reads a sample: lengths, bounds,
/// enumerators and texts. A reply or a state that is not valid is dropped; a request is answered
/// with its fault if its header can be read.
namespace trammel::wire {

/// True if the name can be a reply partition: not empty, and without the wildcards of partition
/// names.
[[nodiscard]] bool valid_partition(std::string_view name);

/// The fault of a serialized sample (its encapsulation first); empty: none. One for each
/// request, reply and state of the IDL.
template <typename Sample>
[[nodiscard]] std::optional<Fault> find_fault(std::span<const unsigned char> sample);
/// The fault of the beginning of any request.
template <>
[[nodiscard]] std::optional<Fault> find_fault<RequestHeader>(std::span<const unsigned char> sample);

}  // namespace trammel::wire
