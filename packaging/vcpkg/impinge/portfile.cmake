# Needs cargo on PATH: vcpkg has no port of Rust.
vcpkg_from_github(
  OUT_SOURCE_PATH SOURCE_PATH
  REPO impinge-rs/impinge
  REF "v${VERSION}"
  # Of the tag's archive; vcpkg prints it where it does not fit.
  SHA512 0
  HEAD_REF main)

vcpkg_check_features(OUT_FEATURE_OPTIONS options FEATURES gpu IMPINGE_GPU)

# The interface is C, and a debug build of Rust would only be slow: programs of both kinds get the same library.
set(VCPKG_BUILD_TYPE release)
vcpkg_cmake_configure(SOURCE_PATH "${SOURCE_PATH}" OPTIONS ${options} -DIMPINGE_PROFILE=library)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/impinge)
# The package now lies in share/impinge, one folder nearer to the prefix.
vcpkg_replace_string("${CURRENT_PACKAGES_DIR}/share/impinge/impinge-config.cmake" "\${CMAKE_CURRENT_LIST_DIR}/../../.."
                     "\${CMAKE_CURRENT_LIST_DIR}/../..")
vcpkg_fixup_pkgconfig()

if(VCPKG_LIBRARY_LINKAGE STREQUAL "static")
  file(GLOB shared "${CURRENT_PACKAGES_DIR}/lib/*.so*" "${CURRENT_PACKAGES_DIR}/lib/*.dylib" "${CURRENT_PACKAGES_DIR}/lib/impinge.lib")
  file(REMOVE_RECURSE ${shared} "${CURRENT_PACKAGES_DIR}/bin")
else()
  file(REMOVE "${CURRENT_PACKAGES_DIR}/lib/libimpinge.a" "${CURRENT_PACKAGES_DIR}/lib/impinge_static.lib")
endif()

vcpkg_install_copyright(FILE_LIST "${SOURCE_PATH}/LICENSE-MIT" "${SOURCE_PATH}/LICENSE-APACHE")
file(INSTALL "${CMAKE_CURRENT_LIST_DIR}/usage" DESTINATION "${CURRENT_PACKAGES_DIR}/share/${PORT}")
