"""The C and C++ library of impinge for Conan 2. `conan create packaging/conan` builds it from this checkout; it needs cargo."""

import os
import re
import shutil

from conan import ConanFile
from conan.errors import ConanInvalidConfiguration
from conan.tools.build import cross_building
from conan.tools.cmake import CMake, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load, rm, rmdir
from conan.tools.scm import Git

required_conan_version = ">=2.0"


class ImpingeConan(ConanFile):
    name = "impinge"
    description = "Exact, real-time collision detection for deforming meshes"
    license = ("MIT", "Apache-2.0")
    url = "https://github.com/impinge-rs/impinge"
    homepage = "https://github.com/impinge-rs/impinge"
    topics = ("collision-detection", "mesh", "geometry", "simulation", "self-intersection")
    package_type = "library"
    settings = "os", "arch", "compiler", "build_type"
    options = {"shared": [True, False], "gpu": [True, False]}
    default_options = {"shared": True, "gpu": False}

    def set_version(self):
        text = load(self, os.path.join(self.recipe_folder, "../../Cargo.toml"))
        self.version = re.search(r'^version = "(.*)"$', text, re.M)[1]

    def export_sources(self):
        root = os.path.normpath(os.path.join(self.recipe_folder, "../.."))
        # What git knows: a build folder is as large as a thousand of these.
        for name in Git(self, root).run("ls-files").splitlines():
            made = os.path.join(self.export_sources_folder, name)
            os.makedirs(os.path.dirname(made), exist_ok=True)
            shutil.copy2(os.path.join(root, name), made)

    def configure(self):
        # The interface is C; the compiler of C++ makes no difference.
        self.settings.rm_safe("compiler.libcxx")
        self.settings.rm_safe("compiler.cppstd")

    def validate(self):
        if cross_building(self):
            raise ConanInvalidConfiguration("this recipe builds for the machine on which it runs: IMPINGE_TARGET of CMakeLists.txt names another")

    def layout(self):
        cmake_layout(self)

    def generate(self):
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables["IMPINGE_GPU"] = bool(self.options.gpu)
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()
        for name in ("LICENSE-MIT", "LICENSE-APACHE"):
            copy(self, name, self.source_folder, os.path.join(self.package_folder, "licenses"))
        # Conan makes these itself.
        rmdir(self, os.path.join(self.package_folder, "lib", "cmake"))
        rmdir(self, os.path.join(self.package_folder, "lib", "pkgconfig"))
        if self.options.shared:
            rm(self, "libimpinge.a", os.path.join(self.package_folder, "lib"))
            rm(self, "impinge_static.lib", os.path.join(self.package_folder, "lib"))
        else:
            rm(self, "libimpinge*.so*", os.path.join(self.package_folder, "lib"))
            rm(self, "libimpinge*.dylib", os.path.join(self.package_folder, "lib"))
            rm(self, "impinge.lib", os.path.join(self.package_folder, "lib"))
            rmdir(self, os.path.join(self.package_folder, "bin"))

    def package_info(self):
        self.cpp_info.set_property("cmake_file_name", "impinge")
        self.cpp_info.set_property("cmake_target_name", "impinge::impinge")
        self.cpp_info.set_property("pkg_config_name", "impinge")
        is_static = not self.options.shared
        self.cpp_info.libs = ["impinge_static" if is_static and self.settings.os == "Windows" else "impinge"]
        if is_static:
            # As IMPINGE_SYSTEM_LIBRARIES of CMakeLists.txt.
            system = {"Windows": ["kernel32", "ntdll", "userenv", "ws2_32", "dbghelp"], "Macos": ["iconv", "m"]}
            self.cpp_info.system_libs = system.get(str(self.settings.os), ["util", "rt", "pthread", "m", "dl"])
