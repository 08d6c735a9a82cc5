#include "base/dense.h"

UNFURL_DENSE()
