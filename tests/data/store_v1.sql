PRAGMA application_id = 1849775180;
PRAGMA user_version = 1;
BEGIN TRANSACTION;
CREATE TABLE battery (
	position BIGINT NOT NULL, 
	entrant TEXT, 
	points DOUBLE, 
	points_low DOUBLE, 
	points_high DOUBLE, 
	rank BIGINT, 
	shortlisted BOOLEAN, 
	PRIMARY KEY (position)
);
CREATE TABLE entrants (
	position BIGINT NOT NULL, 
	entrant TEXT, 
	name TEXT, 
	source TEXT, 
	algorithm TEXT, 
	circuit TEXT, 
	car TEXT, 
	step BIGINT, 
	seed BIGINT, 
	PRIMARY KEY (position)
);
INSERT INTO "entrants" VALUES(0,'ä, "b"
''c''','ä, "b"
''c''','ä, "b"
''c''','ä, "b"
''c''','ä, "b"
''c''','ä, "b"
''c''',-4611686018427387904,-4611686018427387904);
INSERT INTO "entrants" VALUES(1,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE fact (
	"key" TEXT NOT NULL, 
	value TEXT NOT NULL, 
	PRIMARY KEY ("key")
);
INSERT INTO "fact" VALUES('summary','{"seed": 5, "stages": []}');
INSERT INTO "fact" VALUES('version','"0.1.0"');
CREATE TABLE "match" (
	"key" TEXT NOT NULL, 
	stage TEXT NOT NULL, 
	spec TEXT NOT NULL, 
	PRIMARY KEY ("key")
);
INSERT INTO "match" VALUES('z','pareto','{"races": [1, 2], "stage": "pareto", "track": "\u00e4"}');
INSERT INTO "match" VALUES('b','tournament','{"races": [1, 2], "stage": "tournament", "track": "\u00e4"}');
INSERT INTO "match" VALUES('a','pareto','{"races": [1, 2], "stage": "pareto", "track": "\u00e4"}');
CREATE TABLE matchups (
	position BIGINT NOT NULL, 
	entrant TEXT, 
	opponent TEXT, 
	pairs BIGINT, 
	points_per_race DOUBLE, 
	difference DOUBLE, 
	difference_low DOUBLE, 
	difference_high DOUBLE, 
	contacts_per_km DOUBLE, 
	PRIMARY KEY (position)
);
CREATE TABLE pareto (
	position BIGINT NOT NULL, 
	entrant TEXT, 
	lap_s DOUBLE, 
	off_course_share DOUBLE, 
	contacts_per_km DOUBLE, 
	nondominated_probability DOUBLE, 
	survives BOOLEAN, 
	races BIGINT, 
	PRIMARY KEY (position)
);
INSERT INTO "pareto" VALUES(0,'ä, "b"
''c''',3.00000000000000044408e-01,3.00000000000000044408e-01,3.00000000000000044408e-01,3.00000000000000044408e-01,1,-4611686018427387904);
INSERT INTO "pareto" VALUES(1,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE ranking (
	position BIGINT NOT NULL, 
	entrant TEXT, 
	rank BIGINT, 
	points_per_race DOUBLE, 
	points_low DOUBLE, 
	points_high DOUBLE, 
	contacts_per_km DOUBLE, 
	contacts_low DOUBLE, 
	contacts_high DOUBLE, 
	pairs BIGINT, 
	races BIGINT, 
	faults BIGINT, 
	PRIMARY KEY (position)
);
INSERT INTO "ranking" VALUES(0,'ä, "b"
''c''',-4611686018427387904,3.00000000000000044408e-01,3.00000000000000044408e-01,3.00000000000000044408e-01,3.00000000000000044408e-01,3.00000000000000044408e-01,3.00000000000000044408e-01,-4611686018427387904,-4611686018427387904,-4611686018427387904);
INSERT INTO "ranking" VALUES(1,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE result (
	"match" TEXT NOT NULL, 
	stage TEXT, 
	test TEXT, 
	race BIGINT NOT NULL, 
	seed BIGINT, 
	mirrored BOOLEAN, 
	car BIGINT NOT NULL, 
	slot BIGINT, 
	entrant TEXT, 
	team BIGINT, 
	place BIGINT, 
	points DOUBLE, 
	laps BIGINT, 
	ending TEXT, 
	race_time_s DOUBLE, 
	driven_s DOUBLE, 
	distance_m DOUBLE, 
	best_lap_s DOUBLE, 
	off_course_s DOUBLE, 
	wall_s DOUBLE, 
	contacts BIGINT, 
	contacts_faster_behind BIGINT, 
	contacts_at_fault BIGINT, 
	penalties BIGINT, 
	PRIMARY KEY ("match", race, car), 
	FOREIGN KEY("match") REFERENCES "match" ("key")
);
INSERT INTO "result" VALUES('z','pareto','round_robin',0,0,0,0,1,'a',-1,1,0.0,3,'finished',300.0,300.0,1000.0,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('z','pareto','round_robin',0,0,0,1,1,'a',-1,1,0.0,3,'finished',300.0,300.0,500.0,NULL,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('z','pareto','round_robin',0,0,0,2,1,'a',-1,1,0.0,3,'finished',300.0,300.0,3.33333333333333314395e+02,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('z','pareto','round_robin',1,0,0,0,1,'a',-1,1,0.0,3,'finished',300.0,300.0,500.0,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('z','pareto','round_robin',1,0,0,1,1,'a',-1,1,0.0,3,'finished',300.0,300.0,3.33333333333333314395e+02,NULL,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('z','pareto','round_robin',1,0,0,2,1,'a',-1,1,0.0,3,'finished',300.0,300.0,250.0,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('b','tournament','round_robin',0,0,0,0,1,'a',-1,1,0.0,3,'finished',300.0,300.0,1000.0,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('b','tournament','round_robin',0,0,0,1,1,'a',-1,1,0.0,3,'finished',300.0,300.0,500.0,NULL,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('b','tournament','round_robin',0,0,0,2,1,'a',-1,1,0.0,3,'finished',300.0,300.0,3.33333333333333314395e+02,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('b','tournament','round_robin',1,0,0,0,1,'a',-1,1,0.0,3,'finished',300.0,300.0,500.0,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('b','tournament','round_robin',1,0,0,1,1,'a',-1,1,0.0,3,'finished',300.0,300.0,3.33333333333333314395e+02,NULL,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('b','tournament','round_robin',1,0,0,2,1,'a',-1,1,0.0,3,'finished',300.0,300.0,250.0,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('a','pareto','round_robin',0,0,0,0,1,'a',-1,1,0.0,3,'finished',300.0,300.0,1000.0,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('a','pareto','round_robin',0,0,0,1,1,'a',-1,1,0.0,3,'finished',300.0,300.0,500.0,NULL,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('a','pareto','round_robin',0,0,0,2,1,'a',-1,1,0.0,3,'finished',300.0,300.0,3.33333333333333314395e+02,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('a','pareto','round_robin',1,0,0,0,1,'a',-1,1,0.0,3,'finished',300.0,300.0,500.0,95.0,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('a','pareto','round_robin',1,0,0,1,1,'a',-1,1,0.0,3,'finished',300.0,300.0,3.33333333333333314395e+02,NULL,0.0,0.0,0,0,0,0);
INSERT INTO "result" VALUES('a','pareto','round_robin',1,0,0,2,1,'a',-1,1,0.0,3,'finished',300.0,300.0,250.0,95.0,0.0,0.0,0,0,0,0);
CREATE TABLE skills (
	position BIGINT NOT NULL, 
	entrant TEXT, 
	test TEXT, 
	measure DOUBLE, 
	unit TEXT, 
	points DOUBLE, 
	points_low DOUBLE, 
	points_high DOUBLE, 
	runs BIGINT, 
	PRIMARY KEY (position)
);
CREATE INDEX ix_match_stage ON "match" (stage);
COMMIT;
