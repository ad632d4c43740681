"""The event of 2025: a time trial among obstacles, heats and finals, all for points.

Source: Reglement_CourseVoituresAutonomes.md of github.com/ajuton-ens/
CourseVoituresAutonomesSaclay, text of September 2025. That the three races of a final round are
one on each track, and that the best ten take part, is our reading.
"""

from race_server.competition.race_day.formats.format import Format, Obstacles, Races, TimeTrial

FORMAT = Format(
    name="2025",
    title="CoVAPSy 2025",
    stages=(
        TimeTrial("Time trial", track="A", obstacles=Obstacles(), best_points=25, least_points=5),
        Races(
            "Heat",
            tracks="BC",
            laps=3,
            most=8,
            least=4,
            mixed=True,
            points=(10, 6, 4),
            finishing=2,
        ),
        Races(
            "Final",
            tracks="ABC",
            laps=5,
            rounds=2,
            most=10,
            qualified=10,
            points=(25, 18, 15, 12, 10, 8, 6, 4, 2, 1),
        ),
    ),
)
