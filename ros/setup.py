"""Makes the node a ROS 2 package: `colcon build` installs it, the launch file and Foxglove's layout."""

from setuptools import setup

NAME = "robocup_vision_ros"

setup(
    name=NAME,
    version="0.2.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", ["launch/vision.launch.py"]),
        (f"share/{NAME}/foxglove", ["foxglove/layout.json"]),
    ],
    install_requires=["robocup-vision[ros]"],
    zip_safe=True,
    entry_points={"console_scripts": [f"vision = {NAME}.vision:main"]},
)
