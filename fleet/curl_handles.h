// libcurl's objects, freed where their owner ends.
#pragma once

#include <memory>

#include <curl/curl.h>

namespace kiroku::fleet {

template <auto Free>
struct CurlDeleter {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};

using CurlHandle = std::unique_ptr<CURL, CurlDeleter<curl_easy_cleanup>>;
using CurlList = std::unique_ptr<curl_slist, CurlDeleter<curl_slist_free_all>>;
using CurlAddress = std::unique_ptr<CURLU, CurlDeleter<curl_url_cleanup>>;

}  // namespace kiroku::fleet
