#define TRAMMEL_DENSE_ALGEBRA template
#include "server/base/dense_algebra.h"
